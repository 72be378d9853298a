// SPDX-License-Identifier: Apache-2.0
// The node as a component, which shares its process with the camera's driver: images come without a copy. It has less
// than egosgm_ros: mono8 images of equal stamps in, disparity and depth out, motion by stereo odometry.
#include <algorithm>
#include <array>
#include <cstdint>
#include <cstring>
#include <iterator>
#include <limits>
#include <map>
#include <memory>
#include <optional>
#include <rclcpp/rclcpp.hpp>
#include <rclcpp_components/register_node_macro.hpp>
#include <sensor_msgs/msg/camera_info.hpp>
#include <sensor_msgs/msg/image.hpp>
#include <stdexcept>
#include <stereo_msgs/msg/disparity_image.hpp>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include "egosgm/calibration.h"
#include "egosgm/device.h"
#include "egosgm/error.h"
#include "egosgm/frame.h"
#include "egosgm/named_options.h"
#include "egosgm/odometry.h"
#include "egosgm/options.h"
#include "egosgm/pipeline.h"

namespace egosgm_component {

using sensor_msgs::msg::CameraInfo;
using sensor_msgs::msg::Image;
using stereo_msgs::msg::DisparityImage;

/// P and the size of the pixels that there are: a camera info's are of the whole sensor, of which the image shows a
/// region, and binning makes one pixel of several.
struct Camera {
  explicit Camera(const CameraInfo& info)
      : p(info.p),
        width(static_cast<int>(is_cut(info) ? info.roi.width : info.width)),
        height(static_cast<int>(is_cut(info) ? info.roi.height : info.height)) {
    const int across = std::max(1, static_cast<int>(info.binning_x)),
              down = std::max(1, static_cast<int>(info.binning_y));
    for (int i = 0; i < 4; ++i) {
      p[i] = (p[i] - info.roi.x_offset * p[8 + i]) / across;
      p[4 + i] = (p[4 + i] - info.roi.y_offset * p[8 + i]) / down;
    }
    width /= across;
    height /= down;
  }

  static bool is_cut(const CameraInfo& info) { return info.roi.width > 0 && info.roi.height > 0; }

  std::array<double, 12> p;
  int width, height;
};

/// What has to be made anew for another calibration or size.
struct Matching {
  Matching(const Camera& left, const Camera& right, const egosgm::PipelineOptions& options,
           const egosgm::Device& device)
      : calibration{left.p[0],
                    left.p[5],
                    left.p[2],
                    left.p[6],
                    (left.p[3] - right.p[3]) / right.p[0],
                    right.p[2] - left.p[2]},
        width(left.width),
        height(left.height),
        pipeline(calibration, width, height, options, device),
        odometry(calibration) {}

  void reset() {
    pipeline.reset();
    odometry.reset();
  }

  egosgm::Calibration calibration;
  int width, height;
  egosgm::Pipeline pipeline;
  egosgm::StereoOdometry odometry;
  std::optional<std::int64_t> last_stamp;
};

class Disparity : public rclcpp::Node {
 public:
  /// Parameters: the options of the pipeline by their names, `device`, and `reliable` for reliable topics.
  explicit Disparity(const rclcpp::NodeOptions& options)
      : Node("egosgm", options), device_(egosgm::Device::select(parameter("device", ""))) {
    egosgm::set_option(options_, "preset", parameter("preset", "default"));  // first: the others begin with its values
    for (const auto& [name, value] : egosgm::list_options(options_)) {
      if (name != "preset") egosgm::set_option(options_, name, parameter(name, value));
    }

    rclcpp::QoS qos = rclcpp::SensorDataQoS();
    if (parameter("reliable", "false") == "true") qos.reliable();
    for (const auto& [name, value] : get_node_parameters_interface()->get_parameter_overrides()) {
      if (has_parameter(name) || name.rfind("qos_overrides.", 0) == 0) continue;
      throw egosgm::InvalidArgument("parameter " + name +
                                    ": the node has none of this name; docs/use/robots.md names them");
    }
    const rclcpp::QoS newest = rclcpp::QoS(qos).keep_last(1);  // what waits while a pair is matched is replaced
    disparity_ = create_publisher<DisparityImage>("disparity", qos);
    depth_ = create_publisher<Image>("depth", qos);
    for (const int side : {0, 1}) {
      const std::string name = side == 0 ? "left" : "right";
      infos_in_.push_back(create_subscription<CameraInfo>(
          name + "/camera_info", qos, [this, side](CameraInfo::ConstSharedPtr info) { on_info(side, *info); }));
      images_in_.push_back(
          create_subscription<Image>(name + "/image_rect", newest,
                                     [this, side](Image::ConstSharedPtr image) { on_image(side, std::move(image)); }));
    }
  }

 private:
  static constexpr std::size_t kMostWaiting = 8;

  std::string parameter(const std::string& name, const std::string& without) {
    rcl_interfaces::msg::ParameterDescriptor any_type;
    any_type.dynamic_typing = true;  // disparities:=64 is a number, cost:=census9x7 a text
    declare_parameter(name, rclcpp::ParameterValue(without), any_type);
    return get_parameter(name).value_to_string();
  }

  void on_info(int side, const CameraInfo& info) {
    std::optional<CameraInfo>& known = infos_[side];
    const auto of_image = [](const CameraInfo& of) {
      return std::tie(of.p, of.width, of.height, of.binning_x, of.binning_y, of.roi);
    };
    if (!known || of_image(*known) != of_image(info)) matching_.reset();
    known = info;
  }

  void on_image(int side, Image::ConstSharedPtr image) {
    const std::int64_t stamp = rclcpp::Time(image->header.stamp).nanoseconds();
    const auto partner = waiting_[1 - side].find(stamp);
    if (partner == waiting_[1 - side].end()) {
      auto& waiting = waiting_[side];
      const auto place = waiting.emplace(stamp, std::move(image)).first;
      if (waiting.size() > kMostWaiting) {  // a recording that starts over brings what is before all that waits
        waiting.erase(place == waiting.begin() ? std::prev(waiting.end()) : waiting.begin());
      }
      return;
    }
    const Image::ConstSharedPtr other = partner->second;
    for (auto& waiting : waiting_)
      waiting.erase(waiting.begin(), waiting.upper_bound(stamp));  // what is older has lost its partner
    try {
      side == 0 ? process(*image, *other) : process(*other, *image);
    } catch (const std::exception& error) {  // whatever a message held: the next one may be whole
      if (matching_) matching_->reset();     // one of its parts may have gone on without the other
      RCLCPP_ERROR_THROTTLE(get_logger(), *get_clock(), 1000, "%s", error.what());
    }
  }

  egosgm::ImageView view_of(const Image& image) const {
    if (image.encoding != "mono8") throw std::invalid_argument("images of " + image.encoding + ": give mono8");
    if (image.step < image.width || image.data.size() < std::size_t{image.step} * image.height) {
      throw std::invalid_argument("an image has fewer bytes than its size says");
    }
    return {image.data.data(), static_cast<int>(image.width), static_cast<int>(image.height), image.step};
  }

  /// By the topic's name and the camera info, as egosgm_ros has it.
  void warn_of_raw(const CameraInfo& info, const std::string& topic) const {
    const auto is_there = [](double value) { return value != 0; };
    const bool is_turned = info.r != std::array<double, 9>{1, 0, 0, 0, 1, 0, 0, 0, 1} &&
                           std::any_of(info.r.begin(), info.r.end(), is_there);  // all 0: nobody set it
    const std::size_t parent = topic.rfind('/', topic.rfind('/') - 1);
    const bool is_named_rect =
        topic.find("/rect", parent) != std::string::npos || topic.find("_rect", parent) != std::string::npos;
    if (is_named_rect || !(is_turned || std::any_of(info.d.begin(), info.d.end(), is_there))) return;
    RCLCPP_WARN(get_logger(),
                "%s: its camera info has a distortion or a rotation: it is not rectified: remap both cameras' "
                "image_rect to rectified images",
                topic.c_str());
  }

  void process(const Image& left, const Image& right) {
    if (!infos_[0] || !infos_[1]) throw std::runtime_error("no camera info yet of both cameras");
    if (!matching_) {
      matching_ = std::make_unique<Matching>(Camera(*infos_[0]), Camera(*infos_[1]), options_, device_);
      for (const int side : {0, 1}) warn_of_raw(*infos_[side], images_in_[side]->get_topic_name());
    }
    Matching& m = *matching_;
    const std::int64_t stamp = rclcpp::Time(left.header.stamp).nanoseconds();
    if (m.last_stamp && stamp <= *m.last_stamp) m.reset();  // a bag that starts over
    m.last_stamp = stamp;

    auto found = std::make_unique<DisparityImage>();
    found->header = left.header;
    found->f = static_cast<float>(m.calibration.fx);
    found->t = static_cast<float>(m.calibration.baseline_m);
    const double least = options_.min_disparity + m.calibration.doffs_px;
    found->min_disparity = static_cast<float>(std::max(0.0, least));
    found->max_disparity = static_cast<float>(least + options_.disparities - 1);
    found->valid_window.width = m.width;
    found->valid_window.height = m.height;
    found->image = map_of(left, m);
    std::vector<float> values(static_cast<std::size_t>(m.width) * m.height);
    egosgm::FrameOutputs outputs;
    outputs.disparity = {values.data(), m.width, m.height, static_cast<std::ptrdiff_t>(m.width * sizeof(float))};
    m.pipeline.process(view_of(left), view_of(right), m.odometry.process(view_of(left), view_of(right)).motion,
                       outputs);

    std::vector<float> metres(values.size(), std::numeric_limits<float>::quiet_NaN());  // REP 118
    for (std::size_t i = 0; i < values.size(); ++i) {
      const double d = values[i] + m.calibration.doffs_px;
      const bool is_there = values[i] > egosgm::kInvalidDisparity && d >= 0;
      if (is_there && d > 0) metres[i] = static_cast<float>(m.calibration.fx * m.calibration.baseline_m / d);
      values[i] = is_there ? static_cast<float>(d) : -1.0f;  // below min_disparity
    }
    auto depth = std::make_unique<Image>(map_of(left, m));
    std::memcpy(found->image.data.data(), values.data(), found->image.data.size());
    std::memcpy(depth->data.data(), metres.data(), depth->data.size());
    disparity_->publish(std::move(found));
    depth_->publish(std::move(depth));
  }

  static Image map_of(const Image& image, const Matching& m) {
    Image map;
    map.header = image.header;
    map.width = m.width;
    map.height = m.height;
    map.encoding = "32FC1";
    map.step = static_cast<std::uint32_t>(m.width * sizeof(float));
    map.data.resize(std::size_t{map.step} * map.height);
    return map;
  }

  egosgm::PipelineOptions options_;
  egosgm::Device device_;
  std::optional<CameraInfo> infos_[2];
  std::map<std::int64_t, Image::ConstSharedPtr> waiting_[2];
  std::unique_ptr<Matching> matching_;
  rclcpp::Publisher<DisparityImage>::SharedPtr disparity_;
  rclcpp::Publisher<Image>::SharedPtr depth_;
  std::vector<rclcpp::Subscription<CameraInfo>::SharedPtr> infos_in_;
  std::vector<rclcpp::Subscription<Image>::SharedPtr> images_in_;
};

}  // namespace egosgm_component

RCLCPP_COMPONENTS_REGISTER_NODE(egosgm_component::Disparity)
