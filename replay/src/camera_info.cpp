#include "tubetrack/replay/camera_info.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <span>
#include <vector>

#include "refusal.hpp"

namespace tubetrack {

namespace {

template <class T>
T scalar(const YAML::Node& node, const std::string& field, const char* takes) {
  if (!node) throw Refusal{fmt::format("{} is missing; takes {}", field, takes)};
  try {
    return node.as<T>();
  } catch (const YAML::Exception&) {
    throw Refusal{
        fmt::format("{}: got \"{}\", takes {}", field, node.IsScalar() ? node.Scalar() : "a list or map", takes)};
  }
}

/// `field.data`, a flat list of numbers.
std::vector<double> matrix(const YAML::Node& root, const std::string& field) {
  const YAML::Node node = root[field];
  if (!node || !node.IsMap() || !node["data"] || !node["data"].IsSequence()) {
    throw Refusal{fmt::format("{}.data is missing; takes a list of numbers", field)};
  }
  const YAML::Node data = node["data"];
  std::vector<double> values;
  values.reserve(data.size());
  for (std::size_t i = 0; i < data.size(); ++i) {
    values.push_back(scalar<double>(data[i], fmt::format("{}.data[{}]", field, i), "a number"));
  }
  return values;
}

void read_pinhole(const YAML::Node& root, Intrinsics& in) {
  const std::vector<double> k = matrix(root, "camera_matrix");
  if (k.size() != 9) {
    throw Refusal{fmt::format("camera_matrix.data: got {} numbers, takes 9 (fx 0 cx 0 fy cy 0 0 1)", k.size())};
  }
  if (k[1] != 0.0 || k[3] != 0.0 || k[6] != 0.0 || k[7] != 0.0 || k[8] != 1.0) {
    throw Refusal{fmt::format("camera_matrix.data: got [{}], takes fx 0 cx 0 fy cy 0 0 1 by rows, without skew",
                              fmt::join(k, ", "))};
  }
  in.fx_px = k[0];
  in.cx_px = k[2];
  in.fy_px = k[4];
  in.cy_px = k[5];
}

void read_distortion(const YAML::Node& root, Intrinsics& in) {
  if (root["distortion_model"]) {
    const auto model = scalar<std::string>(root["distortion_model"], "distortion_model", "plumb_bob");
    if (model != "plumb_bob" && model != "rational_polynomial" && model != "none" && !model.empty()) {
      throw Refusal{fmt::format("distortion_model: got \"{}\", takes plumb_bob, rational_polynomial or none", model)};
    }
  }
  if (!root["distortion_coefficients"]) return;
  const std::vector<double> k = matrix(root, "distortion_coefficients");
  const std::span<const double> rest = std::span(k).subspan(std::min(k.size(), in.distortion.size()));
  if (std::any_of(rest.begin(), rest.end(), [](double value) { return value != 0.0; })) {
    throw Refusal{
        fmt::format("distortion_coefficients.data: got {} numbers, takes up to 8: k1 k2 p1 p2 k3 k4 k5 k6", k.size())};
  }
  std::copy_n(k.begin(), k.size() - rest.size(), in.distortion.begin());
}

}  // namespace

Expected<CameraInfo> read_camera_info(const std::filesystem::path& path) {
  const auto failed = [&](const std::string& why) {
    return tl::make_unexpected(Error::failed(fmt::format("{}: {}", path.string(), why)));
  };
  try {
    const YAML::Node root = YAML::LoadFile(path.string());
    if (!root.IsMap()) return failed("takes a ROS camera_info: image_width, image_height, camera_matrix, …");
    CameraInfo info;
    info.intrinsics.width = scalar<int>(root["image_width"], "image_width", "pixels");
    info.intrinsics.height = scalar<int>(root["image_height"], "image_height", "pixels");
    read_pinhole(root, info.intrinsics);
    read_distortion(root, info.intrinsics);
    if (root["depth_scale"])
      info.metres_per_unit = scalar<double>(root["depth_scale"], "depth_scale", "metres per unit");
    return info;
  } catch (const Refusal& refusal) {
    return failed(refusal.text);
  } catch (const YAML::ParserException& error) {
    return failed(fmt::format("line {}: no YAML: {}", error.mark.line + 1, error.msg));
  } catch (const std::exception&) {
    return failed("cannot be read; check that it is there and readable");
  }
}

std::string camera_info_yaml(const Intrinsics& in, double metres_per_unit) {
  const auto& k = in.distortion;
  const bool rational = k[5] != 0.0 || k[6] != 0.0 || k[7] != 0.0;
  const std::span<const double> coefficients = std::span(k).first(rational ? 8 : 5);
  return fmt::format(
      "image_width: {}\n"
      "image_height: {}\n"
      "camera_name: depth\n"
      "camera_matrix:\n"
      "  rows: 3\n"
      "  cols: 3\n"
      "  data: [{}, 0.0, {}, 0.0, {}, {}, 0.0, 0.0, 1.0]\n"
      "distortion_model: {}\n"
      "distortion_coefficients:\n"
      "  rows: 1\n"
      "  cols: {}\n"
      "  data: [{}]\n"
      "depth_scale: {}  # metres per unit\n",
      in.width, in.height, in.fx_px, in.cx_px, in.fy_px, in.cy_px, rational ? "rational_polynomial" : "plumb_bob",
      coefficients.size(), fmt::join(coefficients, ", "), metres_per_unit);
}

}  // namespace tubetrack
