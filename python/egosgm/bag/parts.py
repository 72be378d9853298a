# SPDX-License-Identifier: Apache-2.0
"""The files of a bag: what is whole of them is read, and the rest is named."""
import contextlib
import pathlib
import tempfile
from typing import Any, Iterator, List, Optional

from .. import _egosgm
from .ros_images import needs

_SUFFIXES = (".mcap", ".db3", ".bag")
_NO_PROFILE = "Profile"  # what rosbags says of an MCAP that does not call its messages ROS 2's begins so


class Parts:
    """What a reader of rosbags is given for a bag. Copies of what has to be repaired first lie in a folder of their own while this is there."""

    def __init__(self, path: pathlib.Path, highlevel: Any, typesys: Any) -> None:
        self._path, self._highlevel, self._typesys = path, highlevel, typesys
        self._copies: Optional[tempfile.TemporaryDirectory[str]] = None
        self.notes: List[str] = []
        self._files: Optional[List[pathlib.Path]] = None  # those that were found to be whole

    def _reader(self, files: List[pathlib.Path]) -> Any:
        return self._highlevel.AnyReader(files, default_typestore=self._typesys.get_typestore(self._typesys.Stores.LATEST))

    @contextlib.contextmanager
    def reader(self) -> Iterator[Any]:
        if self._files is None:
            self._files = self._find()
        with self._reader(self._files) as reader:
            yield reader

    def _opens(self, files: List[pathlib.Path]) -> Optional[Exception]:
        try:
            with self._reader(files):
                return None
        except Exception as error:  # whatever a decoder of what is broken may raise
            return error

    def _find(self) -> List[pathlib.Path]:
        if self._path.suffix == ".zstd" and self._path.is_file():
            return [self._mended(self._unpacked(self._path))]
        if not self._path.is_dir():
            error = self._opens([self._path])
            return [self._path] if error is None else [self._mended(self._path, error)]
        is_described = (self._path / "metadata.yaml").exists()
        error = self._opens([self._path]) if is_described else None
        if is_described and error is None:
            return [self._path]
        files: List[pathlib.Path] = []
        for suffix in _SUFFIXES:
            files = files or sorted(file for file in self._path.iterdir() if file.suffix == suffix or file.name.endswith(suffix + ".zstd"))
        if not files and not is_described:
            raise _egosgm.InvalidArgument(f"{self._path}: holds no bag, neither metadata.yaml nor {', '.join(_SUFFIXES)}: give a .mcap, a .bag, or a bag's folder")
        if not files:
            return [self._path]
        whole, broken = [], []
        for file in files:
            try:
                part = self._unpacked(file) if file.suffix == ".zstd" else file
                reason = self._opens([part])
                whole.append(part if reason is None else self._mended(part, reason))
            except Exception as failure:  # of this part alone
                broken.append(f"{file.name} ({first_line(failure)})")
        if not whole:
            raise _egosgm.InvalidArgument(f"{self._path}: cannot be read as a bag: none of its parts can be read: {', '.join(broken)}{remedy_of(files[0])}")
        if is_described:
            self.notes.append(f"metadata.yaml does not describe the bag ({first_line(error)}): its parts are read as they are")
        if broken:
            self.notes.append(f"{len(broken)} of {len(files)} parts cannot be read and are left out: {', '.join(broken)}")
        return whole

    def _copy(self, name: str) -> pathlib.Path:
        if self._copies is None:
            self._copies = tempfile.TemporaryDirectory(prefix="egosgm_bag_")
        return pathlib.Path(self._copies.name) / name

    def _unpacked(self, file: pathlib.Path) -> pathlib.Path:
        zstandard = needs("zstandard")
        copy = self._copy(file.stem)
        with open(file, "rb") as packed, open(copy, "wb") as plain:
            zstandard.ZstdDecompressor().copy_stream(packed, plain)
        return copy

    def _mended(self, file: pathlib.Path, error: Optional[Exception] = None) -> pathlib.Path:
        """A part that opens: the file itself, or what its MCAP holds up to where it was cut, or of messages that are ROS 2's without saying so."""
        error = error or self._opens([file])
        if error is None:
            return file
        if file.suffix != ".mcap":
            raise error
        reader, records, writer = needs("mcap.stream_reader"), needs("mcap.records"), needs("mcap.writer")
        copy, count, reason = self._copy(f"mended_{file.name}"), 0, first_line(error)
        with open(file, "rb") as source, open(copy, "wb") as target:
            out, schemas, channels = writer.Writer(target), {0: 0}, {}
            out.start(profile="ros2", library="egosgm")
            try:
                for record in reader.StreamReader(source).records:
                    if isinstance(record, records.Schema) and record.id not in schemas:
                        schemas[record.id] = out.register_schema(record.name, record.encoding, record.data)
                    if isinstance(record, records.Channel) and record.id not in channels:
                        if record.message_encoding == "ros1":
                            raise _egosgm.InvalidArgument(f"{file}: holds messages of ROS 1 in an MCAP, which are not read: give the .bag, or convert "
                                                          "it to ROS 2 (rosbags-convert)")
                        if record.message_encoding != "cdr":
                            raise _egosgm.InvalidArgument(f"{file}: cannot be read as a bag: its messages are not ROS's but {record.message_encoding or 'unnamed'}")
                        channels[record.id] = out.register_channel(record.topic, record.message_encoding, schemas[record.schema_id],
                                                                   {"offered_qos_profiles": ""} | dict(record.metadata))
                    if isinstance(record, records.Message) and record.channel_id in channels:
                        out.add_message(channels[record.channel_id], record.log_time, record.data, record.publish_time, record.sequence)
                        count += 1
            except (_egosgm.InvalidArgument, OSError):
                raise
            except Exception as cut:
                reason = first_line(cut) if reason.startswith(_NO_PROFILE) else reason
            out.finish()
        if count == 0 or self._opens([copy]) is not None:
            raise error
        if not reason.startswith(_NO_PROFILE):
            self.notes.append(f"{file.name} is cut or damaged ({reason}): the {count} messages before are read; `mcap recover` mends it")
        return copy


def first_line(error: Optional[Exception]) -> str:
    """What an error says first, without a full stop: more follows."""
    return str(error).strip().partition("\n")[0].rstrip(".") or type(error).__name__


def remedy_of(file: pathlib.Path) -> str:
    tool = {".mcap": "mcap recover", ".bag": "rosbag reindex", ".db3": "sqlite3 FILE .recover"}.get(file.suffix)
    return f"; if its recording was cut short, `{tool}` mends it" if tool else ""
