// SPDX-License-Identifier: Apache-2.0
// The program in this process, which the package feeds with bags and videos, and whose maps it shows.
#include "apps/program.h"

#include <fmt/core.h>
#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <deque>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include "egosgm/error.h"
#include "python/arrays.h"
#include "python/bindings.h"
#include "python/frame.h"
#include "python/option_values.h"

namespace egosgm::python {
namespace {

/// Does what needs the interpreter, in any thread. Python's errors become those of the library.
template <typename Do>
auto in_python(Do&& act) {
  const py::gil_scoped_acquire python;
  try {
    return act();
  } catch (const py::error_already_set& error) {
    const py::module_ module = py::module_::import("egosgm._egosgm");
    const std::string text = text_from(error.value());
    if (error.matches(module.attr("InvalidArgument"))) throw InvalidArgument(text);
    if (error.matches(PyExc_OSError)) throw IoError(text);
    throw std::runtime_error(error.what());
  }
}

/// A Python object of which no thread has to hold the interpreter's lock when it goes.
class Held {
 public:
  explicit Held(py::object object) : object_(std::move(object)) {}
  ~Held() {
    const py::gil_scoped_acquire python;
    object_.release().dec_ref();
  }
  Held(const Held&) = delete;
  Held& operator=(const Held&) = delete;
  py::object call(const char* method, const auto&... arguments) const { return object_.attr(method)(arguments...); }
  py::object operator[](const char* name) const { return object_.attr(name); }

 private:
  py::object object_;
};

/// egosgm.bag.program.BagSource or VideoSource.
class PackageSource : public vision::FrameSource {
 public:
  PackageSource(py::object source, vision::FrameRange range, const std::string& out)
      : source_(std::move(source)), range_(range) {
    sequence_.title = text_from(source_["title"]);
    sequence_.note = text_from(source_["note"]);
    sequence_.has_calibration = source_["has_calibration"].cast<bool>();
    sequence_.calibration = source_["calibration"].cast<Calibration>();
    size_ = {source_["width"].cast<int>(), source_["height"].cast<int>()};
    type_ = source_["bits"].cast<int>() == 8 ? PixelType::kU8 : PixelType::kU16;
    poses_ = text_from(source_["poses"]);
    out_ = out;
    const int count = source_["count"].cast<int>(), first = range.first.value_or(0);
    if (first >= count) {
      throw InvalidArgument(
          fmt::format("--frames: {} has at most {} frames, which begin with 0", sequence_.title, count));
    }
    for (int number = first; number <= std::min(range.last.value_or(count - 1), count - 1); ++number) {
      sequence_.frames.push_back(frame_of(number));
    }
  }

  bool has_no_files() const override { return true; }
  std::string poses() const override { return poses_; }

  std::optional<vision::VideoPair> next() override {
    return in_python([&]() -> std::optional<vision::VideoPair> {
      for (;;) {
        const py::object found = source_.call("next");
        if (found.is_none()) {
          has_ended_ = true;
          if (has_given_) return std::nullopt;
          throw InvalidArgument(
              fmt::format("--frames: {} has {} frames, which begin with 0", sequence_.title, last_ + 1));
        }
        const int number = last_ = found.attr("number").cast<int>();
        if (number < range_.first.value_or(0)) continue;
        if (number > range_.last.value_or(number)) return std::nullopt;
        has_given_ = true;
        vision::VideoPair pair;
        pair.frame = frame_of(number);
        pair.images = {mat_of(found.attr("left"), "left"), mat_of(found.attr("right"), "right")};
        pair.starts_anew = found.attr("starts_anew").cast<bool>();
        pair.stamp_ns = found.attr("stamp_ns").cast<std::optional<std::int64_t>>();
        pair.camera = found.attr("frame_id").cast<std::string>();
        const py::object pose = found.attr("world_from_camera");
        if (!pose.is_none()) pair.world_from_camera = transform_of(pose, "pose");
        return pair;
      }
    });
  }

  bool has_lost_images() const override {
    return in_python([&] { return source_["has_lost_images"].cast<bool>(); });
  }

  std::vector<std::string> notes() const override {
    return in_python([&] {
      std::vector<std::string> notes;
      for (const py::handle& note : source_.call("notes")) notes.push_back(text_from(note));
      if (has_ended_ && range_.last.value_or(last_) > last_) {
        notes.push_back(fmt::format("--frames asks for frame {}, and the last one is {}", *range_.last, last_));
      }
      return notes;
    });
  }

 private:
  vision::StereoFrame frame_of(int number) const {
    vision::StereoFrame frame;
    frame.number = number;
    frame.name = fmt::format("{:06}", number);
    frame.left = out_ / "left" / (frame.name + ".png");
    return frame;
  }

  const Held source_;
  const vision::FrameRange range_;
  std::filesystem::path out_;
  std::string poses_;
  int last_ = -1;  // frame that the source gave
  bool has_given_ = false, has_ended_ = false;
};

/// egosgm.bag.program.Outputs.
class Outputs : public app::FrameSink {
 public:
  explicit Outputs(py::object outputs) : outputs_(std::move(outputs)) {}

  void begin(const PipelineOptions& options, const Calibration& calibration) override {
    in_python([&] { outputs_.call("begin", dict_of(options), calibration); });
  }

  void take(const vision::VideoFrame& made, const app::ShownMaps& maps) override {
    in_python([&] {
      const vision::VideoPair& pair = made.pair;
      py::dict frame;
      frame["number"] = pair.frame.number;
      frame["name"] = pair.frame.name;
      frame["left"] = array_of(pair.images.left);
      frame["right"] = array_of(pair.images.right);
      frame["starts_anew"] = pair.starts_anew;
      frame["frame_id"] = pair.camera;
      if (pair.stamp_ns) frame["stamp_ns"] = *pair.stamp_ns;
      if (maps.objects) frame["objects"] = *maps.objects;
      Frame result{.maps = {}, .report = made.report};
      for (const auto& [name, map] :
           {std::pair{"disparity", &maps.disparity}, {"variance", &maps.variance}, {"reason", &maps.reason}}) {
        if (!map->empty()) result.maps[name] = array_of(map->clone());
      }
      const std::optional<Motion>& motion = made.motion.motion;
      outputs_.call("take", frame, result,
                    motion ? py::object(array_of(motion->current_from_previous)) : py::object(py::none()));
    });
  }

  void end(bool finished) override {
    in_python([&] { outputs_.call("end", finished); });
  }

 private:
  const Held outputs_;
};

/// `read` outlives it: who copies it need not hold the interpreter's lock.
app::CalibrationReader reader_of(const py::object& read) {
  return [&read](const std::string& file, vision::Size size, const std::string&) {
    return in_python([&] {
      const py::object found = read(std::filesystem::path(file), py::make_tuple(size.width, size.height));
      return found.cast<std::optional<Calibration>>();
    });
  };
}

/// The options of app::SequenceArguments for argparse: names, what the value is called, help.
std::vector<std::tuple<std::vector<std::string>, std::string, std::string>> input_options() {
  CLI::App command;
  app::SequenceArguments().add_to(command);
  std::vector<std::tuple<std::vector<std::string>, std::string, std::string>> options;
  for (const CLI::Option* option : command.get_options()) {
    if (option == command.get_help_ptr()) continue;
    const std::string name = option->get_name(/*positional=*/true, /*all_options=*/true);
    options.emplace_back(CLI::detail::split(name, ','), option->get_type_name(), option->get_description());
  }
  return options;
}

/// The sequence that a command's words name. `read`: as for app::SequenceArguments::open.
vision::StereoSequence open_input(std::vector<std::string> words, const py::object& read) {
  CLI::App command;
  app::SequenceArguments arguments;
  arguments.add_to(command);
  try {
    std::reverse(words.begin(), words.end());  // as CLI11 takes them
    command.parse(words);
  } catch (const CLI::ParseError& error) {
    throw InvalidArgument(std::string(error.what()) + ": give one input");
  }
  const py::gil_scoped_release other_threads_run;
  return arguments.open(/*needs_calibration=*/false, reader_of(read));
}

/// The program's exit code. `package`: what opens bags and outputs, see egosgm.bag.program.
int main_of(const std::vector<std::string>& arguments, const py::object& package) {
  app::Package hooks;
  hooks.open_bag = [&](const app::BagArguments& given, const std::string& calib, vision::FrameRange range,
                       const std::string& out) {
    return in_python([&]() -> std::shared_ptr<vision::FrameSource> {
      py::dict values;
      for (const auto& [name, value] : {std::pair{"bag", given.bag},
                                        {"left_topic", given.left_topic},
                                        {"right_topic", given.right_topic},
                                        {"pose_topic", given.pose_topic},
                                        {"pose_axes", given.pose_axes},
                                        {"max_skew_ms", given.max_skew_ms},
                                        {"rectify", given.rectify},
                                        {"calib", calib},
                                        {"out", out}}) {
        values[name] = text_of(value);
      }
      py::list info_topics;
      for (const std::string& topic : given.info_topics) info_topics.append(text_of(topic));
      values["info_topics"] = info_topics;
      return std::make_shared<PackageSource>(package.attr("BagSource")(**values), range, out);
    });
  };
  hooks.open_videos = [&](const app::VideoArguments& videos, const std::string& calib, vision::FrameRange range,
                          const std::string& out) {
    return in_python([&]() -> std::shared_ptr<vision::FrameSource> {
      return std::make_shared<PackageSource>(
          package.attr("VideoSource")(text_of(videos.left), text_of(videos.right), text_of(calib)), range, out);
    });
  };
  hooks.take = [&](const std::string& file, bool viewer, bool page) {
    return in_python([&]() -> std::shared_ptr<app::FrameSink> {
      return std::make_shared<Outputs>(package.attr("Outputs")(text_of(file), viewer, page));
    });
  };
  const py::object read = package.attr("read_calibration");
  hooks.read_calibration = reader_of(read);
  std::vector<const char*> words{"egosgm"};
  for (const std::string& argument : arguments) words.push_back(argument.c_str());
  words.push_back(nullptr);
  const py::gil_scoped_release other_threads_run;
  return app::run_program(static_cast<int>(words.size()) - 1, words.data(), &hooks);
}

}  // namespace

void bind_program(py::module_& module) {
  module.def("_main", &main_of, py::arg("arguments"), py::arg("package"));
  module.def("_input_options", &input_options);
  module.def("_open_input", &open_input, py::arg("words"), py::arg("read"));
}

}  // namespace egosgm::python
