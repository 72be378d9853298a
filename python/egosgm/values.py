# SPDX-License-Identifier: Apache-2.0
"""Reports as Python's dataclasses: repr, ==, dataclasses.asdict and fields, of classes that the library fills."""
import dataclasses


def as_dataclass(cls: type, hidden: tuple = ()) -> None:
    """Of a class whose members are read-only properties, in the order in which the library has them."""
    names = [name for name, member in vars(cls).items() if isinstance(member, property) and name not in hidden]
    model = dataclasses.make_dataclass(cls.__name__, names)
    cls.__dataclass_fields__ = model.__dataclass_fields__
    cls.__match_args__ = tuple(names)
    cls.__repr__ = lambda self: f"{cls.__name__}({', '.join(f'{name}={getattr(self, name)!r}' for name in names)})"
    cls.__eq__ = lambda self, other: (all(getattr(self, name) == getattr(other, name) for name in names)
                                      if isinstance(other, cls) else NotImplemented)
    cls.__hash__ = None
