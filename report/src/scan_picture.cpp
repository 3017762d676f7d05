#include "tubetrack/report/scan_picture.hpp"

#include <fmt/format.h>

#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

namespace tubetrack {

namespace {

constexpr int kSide = 800, kOver = 2;  // rendered at twice the size, against jagged edges
constexpr double kMargin = 0.05;
constexpr std::array<std::uint8_t, 3> kGrey{170, 170, 170};

/// World to picture: x right, y down, z away from the viewer, in pixels of one panel.
struct View {
  Eigen::Matrix3d turn = Eigen::Matrix3d::Identity();
  Eigen::Vector3d middle_m = Eigen::Vector3d::Zero();
  double pixels_per_m = 1.0;

  Eigen::Vector3d see(const Eigen::Vector3d& point_m) const {
    const double half = 0.5 * kSide * kOver;
    return pixels_per_m * (turn * (point_m - middle_m)) + Eigen::Vector3d(half, half, 0.0);
  }
};

View view_of(std::span<const SurfaceMesh> surfaces) {
  View view;
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  Eigen::Matrix3d squares = Eigen::Matrix3d::Zero();
  double count = 0.0;
  const auto finite = [](const Eigen::Vector3d& point) { return point.allFinite(); };
  for (const SurfaceMesh& surface : surfaces) {
    for (const Eigen::Vector3d& point : surface.points_m) {
      if (!finite(point)) continue;
      mean += point;
      count += 1.0;
    }
  }
  if (!(count > 0.0)) return view;
  mean /= count;
  for (const SurfaceMesh& surface : surfaces) {
    for (const Eigen::Vector3d& point : surface.points_m) {
      if (finite(point)) squares += (point - mean) * (point - mean).transpose();
    }
  }
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(squares);
  // Broadest along x; a little from above and from the side, or a flat tube would hide how it is bent.
  view.turn.row(0) = solver.eigenvectors().col(2).transpose();
  view.turn.row(1) = solver.eigenvectors().col(1).transpose();
  view.turn.row(2) = view.turn.row(0).cross(view.turn.row(1));
  const Eigen::Matrix3d tilt =
      (Eigen::AngleAxisd(0.35, Eigen::Vector3d::UnitX()) * Eigen::AngleAxisd(0.25, Eigen::Vector3d::UnitY()))
          .toRotationMatrix();
  view.turn = tilt * view.turn;
  Eigen::AlignedBox3d box;
  for (const SurfaceMesh& surface : surfaces) {
    for (const Eigen::Vector3d& point : surface.points_m) {
      if (finite(point)) box.extend(view.turn * point);
    }
  }
  view.middle_m = view.turn.transpose() * box.center();
  const double broad_m = std::max({box.sizes().x(), box.sizes().y(), 1e-9});
  view.pixels_per_m = kSide * kOver * (1.0 - 2.0 * kMargin) / broad_m;
  return view;
}

struct Panel {
  cv::Mat image{kSide * kOver, kSide* kOver, CV_8UC3, cv::Scalar(255, 255, 255)};
  cv::Mat depth{kSide * kOver, kSide* kOver, CV_64F, cv::Scalar(std::numeric_limits<double>::infinity())};

  void set(int row, int col, double z, const Eigen::Vector3d& color) {
    if (row < 0 || col < 0 || row >= image.rows || col >= image.cols || !(z < depth.at<double>(row, col))) return;
    depth.at<double>(row, col) = z;
    const auto byte = [](double value) { return static_cast<std::uint8_t>(std::clamp(value, 0.0, 255.0)); };
    image.at<cv::Vec3b>(row, col) = {byte(color[2]), byte(color[1]), byte(color[0])};
  }
};

Eigen::Vector3d color_of(const SurfaceMesh& surface, std::size_t point) {
  const auto& color = surface.colors.empty() ? kGrey : surface.colors[point];
  return {1.0 * color[0], 1.0 * color[1], 1.0 * color[2]};
}

void draw_face(const SurfaceMesh& surface, const std::array<std::uint32_t, 3>& face, const View& view, Panel& panel) {
  Eigen::Vector3d corner[3], color[3];
  for (std::size_t k = 0; k < 3; ++k) {
    corner[k] = view.see(surface.points_m[face[k]]);
    color[k] = color_of(surface, face[k]);
  }
  const Eigen::Vector3d normal = (corner[1] - corner[0]).cross(corner[2] - corner[0]).normalized();
  // A light at the viewer's left shoulder; backs as bright as fronts, for open meshes show them.
  const double light = 0.25 + 0.75 * std::abs(normal.dot(Eigen::Vector3d(-0.3, -0.4, -0.866)));
  const double area = (corner[1] - corner[0]).x() * (corner[2] - corner[0]).y() -
                      (corner[1] - corner[0]).y() * (corner[2] - corner[0]).x();
  if (!(std::abs(area) > 1e-9)) return;
  const auto [left, right] = std::minmax({corner[0].x(), corner[1].x(), corner[2].x()});
  const auto [top, bottom] = std::minmax({corner[0].y(), corner[1].y(), corner[2].y()});
  for (int row = static_cast<int>(std::ceil(top)); row <= bottom; ++row) {
    for (int col = static_cast<int>(std::ceil(left)); col <= right; ++col) {
      double share[3];
      bool inside = true;
      for (std::size_t k = 0; k < 3; ++k) {
        const Eigen::Vector3d &from = corner[(k + 1) % 3], &to = corner[(k + 2) % 3];
        share[k] = ((to.x() - from.x()) * (row - from.y()) - (to.y() - from.y()) * (col - from.x())) / area;
        inside = inside && share[k] >= -1e-9;
      }
      if (!inside) continue;
      const double z = share[0] * corner[0].z() + share[1] * corner[1].z() + share[2] * corner[2].z();
      panel.set(row, col, z, light * (share[0] * color[0] + share[1] * color[1] + share[2] * color[2]));
    }
  }
}

void draw_point(const SurfaceMesh& surface, std::size_t point, const View& view, Panel& panel) {
  const Eigen::Vector3d at = view.see(surface.points_m[point]);
  constexpr int kHalf = 2;
  for (int row = -kHalf; row <= kHalf; ++row) {
    for (int col = -kHalf; col <= kHalf; ++col) {
      panel.set(static_cast<int>(std::lround(at.y())) + row, static_cast<int>(std::lround(at.x())) + col, at.z(),
                color_of(surface, point));
    }
  }
}

}  // namespace

Expected<void> write_scan_picture(const std::filesystem::path& path, std::span<const SurfaceMesh> surfaces) {
  const View view = view_of(surfaces);
  std::vector<cv::Mat> panels;
  for (const SurfaceMesh& surface : surfaces) {
    Panel panel;
    for (const auto& face : surface.faces) draw_face(surface, face, view, panel);
    for (std::size_t i = 0; surface.faces.empty() && i < surface.points_m.size(); ++i) {
      if (surface.points_m[i].allFinite()) draw_point(surface, i, view, panel);
    }
    cv::Mat small;
    cv::resize(panel.image, small, {kSide, kSide}, 0.0, 0.0, cv::INTER_AREA);
    panels.push_back(std::move(small));
  }
  bool written = false;
  try {
    cv::Mat all;
    cv::hconcat(panels, all);
    written = cv::imwrite(path.string(), all);
  } catch (const cv::Exception& problem) {
    return tl::make_unexpected(Error::failed(fmt::format("{}: {}", path.string(), problem.err)));
  }
  if (!written) {
    return tl::make_unexpected(
        Error::usage(fmt::format("{}: cannot be written; give a .png in an existing folder", path.string())));
  }
  return {};
}

}  // namespace tubetrack
