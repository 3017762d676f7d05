#include "tubetrack/report/overlay.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <optional>
#include <vector>

namespace tubetrack {

namespace {

// Colours that stay apart on grey, also for most colour-blind readers; blue, green, red.
const std::array<cv::Scalar, 8> kColors = {
    cv::Scalar(0, 159, 230),   cv::Scalar(233, 180, 86),  cv::Scalar(115, 198, 0), cv::Scalar(66, 228, 240),
    cv::Scalar(200, 130, 255), cv::Scalar(255, 255, 120), cv::Scalar(80, 80, 255), cv::Scalar(255, 120, 200)};
constexpr double kNearest_m = 0.05;  ///< nothing nearer is drawn: it would project wildly

struct TubeOutline {
  std::vector<std::optional<cv::Point2d>> middle, left, right;  ///< empty: behind the camera
};

/// Depth between its 2nd and 98th percentile as 1 (near) to 0, no return below 0. Square root, since a scene's tubes
/// are in front and its far walls would take up the shades.
cv::Mat nearness(const DepthFrame& frame) {
  std::vector<std::uint16_t> values;
  for (int v = 0; v < frame.height; v += 3) {
    for (int u = 0; u < frame.width; u += 3) {
      if (frame.row(v)[u] != 0) values.push_back(frame.row(v)[u]);
    }
  }
  cv::Mat near(frame.height, frame.width, CV_32F, cv::Scalar(-1.0));
  if (values.empty()) return near;
  std::sort(values.begin(), values.end());
  const double near_units = values[values.size() / 50];
  const double far_units = std::max<double>(values[values.size() - 1 - values.size() / 50], near_units + 1.0);
  for (int v = 0; v < frame.height; ++v) {
    for (int u = 0; u < frame.width; ++u) {
      const std::uint16_t units = frame.row(v)[u];
      if (units == 0) continue;
      const double part = std::clamp((units - near_units) / (far_units - near_units), 0.0, 1.0);
      near.at<float>(v, u) = static_cast<float>(1.0 - std::sqrt(part));
    }
  }
  return near;
}

cv::Mat grey_picture(const DepthFrame& frame) {
  const cv::Mat near = nearness(frame);
  cv::Mat picture(near.size(), CV_8UC3, cv::Scalar(0, 0, 0));
  for (int v = 0; v < near.rows; ++v) {
    for (int u = 0; u < near.cols; ++u) {
      if (near.at<float>(v, u) < 0.0F) continue;
      const auto grey = static_cast<unsigned char>(45.0 + 140.0 * near.at<float>(v, u));
      picture.at<cv::Vec3b>(v, u) = cv::Vec3b(grey, grey, grey);
    }
  }
  return picture;
}

/// Darkened, so that what is drawn on it stands out.
cv::Mat false_color_picture(const DepthFrame& frame) {
  const cv::Mat near = nearness(frame);
  cv::Mat shades;
  near.convertTo(shades, CV_8U, 215.0, 30.0);  // without the ends of the scale, which are nearly black
  cv::Mat picture;
  cv::applyColorMap(shades, picture, cv::COLORMAP_TURBO);
  picture *= 0.6;
  picture.setTo(cv::Scalar(0, 0, 0), near < 0.0);
  return picture;
}

std::optional<cv::Point2d> projected(const Intrinsics& intrinsics, const Eigen::Vector3d& point_in_camera) {
  if (point_in_camera.z() < kNearest_m) return {};
  const Eigen::Vector2d pixel = project(intrinsics, point_in_camera);
  // Far outside the picture OpenCV's integer coordinates would overflow.
  if (!pixel.allFinite() || pixel.cwiseAbs().maxCoeff() > 20000.0) return {};
  return cv::Point2d(pixel.x(), pixel.y());
}

/// Where the rays through the camera centre graze a cylinder about the centreline: at axial distance d (the line of
/// sight's part across the tangent), the tangent point is R²/d towards the camera and ±R √(1 − R²/d²) sideways.
TubeOutline outline(const Tube& tube, const Intrinsics& intrinsics, const Eigen::Isometry3d& camera_from_result) {
  const std::size_t count = tube.centerline_m.size();
  std::vector<Eigen::Vector3d> nodes(count);
  for (std::size_t i = 0; i < count; ++i) nodes[i] = camera_from_result * tube.centerline_m[i];
  TubeOutline result;
  for (std::size_t i = 0; i < count; ++i) {
    const Eigen::Vector3d tangent = (nodes[std::min(i + 1, count - 1)] - nodes[i == 0 ? 0 : i - 1]).normalized();
    const Eigen::Vector3d across = -nodes[i] + nodes[i].dot(tangent) * tangent;  // towards the camera
    const double distance_m = across.norm();
    result.middle.push_back(projected(intrinsics, nodes[i]));
    if (!(distance_m > tube.radius_m)) {  // looking along the tube: it has no silhouette
      result.left.emplace_back();
      result.right.emplace_back();
      continue;
    }
    const Eigen::Vector3d toward = across / distance_m;
    const Eigen::Vector3d sideways = tangent.cross(toward);
    const double sine = tube.radius_m / distance_m;
    const Eigen::Vector3d front = nodes[i] + tube.radius_m * sine * toward;
    const Eigen::Vector3d aside = tube.radius_m * std::sqrt(1.0 - sine * sine) * sideways;
    result.left.push_back(projected(intrinsics, front + aside));
    result.right.push_back(projected(intrinsics, front - aside));
  }
  return result;
}

cv::Scalar paler(const cv::Scalar& color) {
  return color * 0.5 + cv::Scalar(60, 60, 60);
}

void draw_line(cv::Mat& picture, const std::vector<std::optional<cv::Point2d>>& points,
               const std::vector<bool>& visible, const cv::Scalar& color, int thickness_px) {
  constexpr double kDash_px = 6.0;
  constexpr int kShift = 4;  // drawn in 1/16 pixels
  const auto line = [&](const cv::Point2d& a, const cv::Point2d& b, const cv::Scalar& c) {
    cv::line(picture, cv::Point(a * (1 << kShift)), cv::Point(b * (1 << kShift)), c, thickness_px, cv::LINE_AA, kShift);
  };
  double drawn_px = 0.0;
  for (std::size_t i = 0; i + 1 < points.size(); ++i) {
    const auto& from = points[i];
    const auto& to = points[i + 1];
    if (!from || !to) continue;
    const bool seen = i + 1 >= visible.size() || (visible[i] && visible[i + 1]);
    if (seen) {
      line(*from, *to, color);
      continue;
    }
    // Short pieces, every other one drawn: the dashes go on across nodes.
    const cv::Point2d way = *to - *from;
    const double length_px = std::hypot(way.x, way.y);
    const int pieces = std::max(1, static_cast<int>(std::ceil(std::min(length_px, 4000.0) / 2.0)));
    for (int k = 0; k < pieces; ++k) {
      if (static_cast<int>((drawn_px + length_px * k / pieces) / kDash_px) % 2 == 0) {
        line(*from + way * (static_cast<double>(k) / pieces), *from + way * (k + 1.0) / pieces, paler(color));
      }
    }
    drawn_px += length_px;
  }
}

void draw_text(cv::Mat& picture, const std::string& text, cv::Point at, double scale, const cv::Scalar& color) {
  int below_px = 0;
  const cv::Size size = cv::getTextSize(text, cv::FONT_HERSHEY_SIMPLEX, scale, 1, &below_px);
  at.x = std::clamp(at.x, 2, std::max(2, picture.cols - size.width - 2));
  at.y = std::clamp(at.y, size.height + 2, std::max(size.height + 2, picture.rows - below_px - 2));
  cv::putText(picture, text, at, cv::FONT_HERSHEY_SIMPLEX, scale, cv::Scalar(0, 0, 0), 4, cv::LINE_AA);
  cv::putText(picture, text, at, cv::FONT_HERSHEY_SIMPLEX, scale, color, 1, cv::LINE_AA);
}

void draw_tube(cv::Mat& picture, const Tube& tube, const Intrinsics& intrinsics,
               const Eigen::Isometry3d& camera_from_result, double text_scale) {
  const cv::Scalar& color = kColors[static_cast<std::size_t>(std::abs(tube.id)) % kColors.size()];
  const TubeOutline lines = outline(tube, intrinsics, camera_from_result);
  draw_line(picture, lines.left, tube.node_visible, color, 1);
  draw_line(picture, lines.right, tube.node_visible, color, 1);
  draw_line(picture, lines.middle, tube.node_visible, color, 2);
  // Near an end: tubes cross in their middles.
  for (std::size_t i = 5 * lines.middle.size() / 6; i-- > 0;) {
    const auto& point = lines.middle[i];
    if (!point) continue;
    const cv::Point at(static_cast<int>(point->x) + 8, static_cast<int>(point->y) - 4);
    draw_text(picture, fmt::format("{}: {:.1f} mm", tube.id, tube.radius_m * 1e3), at, text_scale, color);
    break;
  }
}

/// Tubes and caption onto the picture of the depth.
void draw_result(cv::Mat& picture, const DepthFrame& frame, const Intrinsics& intrinsics, const TubeFrame& result,
                 const std::string& more) {
  const Eigen::Isometry3d camera_from_result = result.frame_id == "world" && frame.world_from_camera
                                                   ? frame.world_from_camera->inverse()
                                                   : Eigen::Isometry3d::Identity();
  const double text_scale = std::max(0.4, 0.5 * frame.width / 640.0);
  for (const Tube& tube : result.tubes) draw_tube(picture, tube, intrinsics, camera_from_result, text_scale);
  const std::string caption = fmt::format("frame {}   {:.3f} s   {} tube{}   {}", result.frame, result.timestamp_s,
                                          result.tubes.size(), result.tubes.size() == 1 ? "" : "s", more);
  draw_text(picture, caption, {6, picture.rows - 8}, text_scale, cv::Scalar(255, 255, 255));
}

}  // namespace

Expected<void> write_overlay(const std::filesystem::path& path, const DepthFrame& frame, const Intrinsics& intrinsics,
                             const TubeFrame& result) {
  try {
    cv::Mat picture = grey_picture(frame);
    draw_result(picture, frame, intrinsics, result, "radius in mm");
    if (cv::imwrite(path.string(), picture)) return {};
    return tl::make_unexpected(
        Error::failed(fmt::format("{}: the overlay cannot be written; is the disk full?", path.string())));
  } catch (const cv::Exception& problem) {
    return tl::make_unexpected(
        Error::failed(fmt::format("{}: the overlay cannot be written: {}", path.string(), problem.err)));
  }
}

Picture draw_view(const DepthFrame& frame, const Intrinsics& intrinsics, const TubeFrame& result) {
  cv::Mat picture = false_color_picture(frame);
  draw_result(picture, frame, intrinsics, result,
              fmt::format("latency {:.1f} ms   dropped {}", result.latency_ms, result.dropped));
  return {picture.cols, picture.rows, {picture.datastart, picture.dataend}};
}

}  // namespace tubetrack
