#include <fmt/format.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <map>
#include <optional>

#include "tubetrack/replay/noise_calibration.hpp"

namespace tubetrack {

namespace {

constexpr int kHalfWindow_px = 4;
constexpr double kReturnsShare = 0.9;
constexpr double kMaxIncidence_rad = 1.43;  ///< 82°: beyond, the window itself is too coarse

/// One pixel over time, in metres.
struct PixelStatistics {
  bool judged = false;
  bool changed = false;
  double mean_m = 0.0;
  double variance_m2 = 0.0;
  double change2_m2 = 0.0;  ///< half the mean squared change from return to return: the variance, if nothing drifts
};

PixelStatistics statistics_of(const PixelSums& sums, double metres_per_unit) {
  PixelStatistics pixel;
  pixel.judged = true;
  const auto n = static_cast<double>(sums.returns);
  const auto sum = static_cast<double>(sums.sum);
  const double unit2 = metres_per_unit * metres_per_unit;
  // n Σx² − (Σx)² is exact in integers: no cancellation.
  const auto n_n_variance = static_cast<double>(sums.returns * sums.sum_of_squares - sums.sum * sums.sum);
  pixel.mean_m = sum / n * metres_per_unit;
  pixel.variance_m2 = n_n_variance / (n * (n - 1.0)) * unit2;
  pixel.change2_m2 = static_cast<double>(sums.squared_changes) / (2.0 * (n - 1.0)) * unit2;
  return pixel;
}

int depth_bin(double depth_m) {
  return static_cast<int>(std::floor(std::log(depth_m) / std::log(1.1)));
}

/// Marks the pixels that did more than be noisy.
void mark_changed(std::vector<PixelStatistics>& pixels, std::int64_t frames, const RoundingSteps& steps) {
  std::map<int, std::vector<double>> variances;
  for (const PixelStatistics& p : pixels) {
    if (p.judged) variances[depth_bin(p.mean_m)].push_back(p.variance_m2);
  }
  std::map<int, double> usual;
  for (auto& [bin, values] : variances) {
    const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
    std::nth_element(values.begin(), middle, values.end());
    usual[bin] = *middle;
  }
  // Von Neumann's ratio, change² / variance, is 1 ± this for noise without memory.
  const auto n = static_cast<double>(frames);
  const double ratio_sigma = std::sqrt((n - 2.0) / (n * n - 1.0));
  const double drifts_below = std::min(0.3, 1.0 - 3.0 * ratio_sigma);
  for (PixelStatistics& p : pixels) {
    if (!p.judged) continue;
    const double step = steps.at(p.mean_m);
    const bool more_than_a_step = p.variance_m2 > 0.5 * step * step;  // to and fro over one step is 0.28
    const bool drifts = more_than_a_step && p.change2_m2 < drifts_below * p.variance_m2;
    const bool stands_out = p.variance_m2 > 64.0 * usual[depth_bin(p.mean_m)] + 4.0 * step * step;
    const bool impossible = std::sqrt(p.variance_m2) > 0.03 * p.mean_m + 2.0 * step;
    p.changed = drifts || stands_out || impossible;
  }
}

/// The surface around a pixel: w = a x + b y + c in inverse depth and ray coordinates.
std::optional<Eigen::Vector3d> plane_at(const std::vector<PixelStatistics>& pixels,
                                        const std::vector<Eigen::Vector2f>& rays, int width, int u, int v,
                                        const RoundingSteps& steps, double frames) {
  Eigen::Matrix3d normal = Eigen::Matrix3d::Zero();
  Eigen::Vector3d right = Eigen::Vector3d::Zero();
  double sum_w2 = 0.0;
  double variance_m2 = 0.0;
  const auto index = [width](int uu, int vv) { return static_cast<std::size_t>(vv) * width + uu; };
  const Eigen::Vector2d center = rays[index(u, v)].cast<double>();
  for (int vv = v - kHalfWindow_px; vv <= v + kHalfWindow_px; ++vv) {
    for (int uu = u - kHalfWindow_px; uu <= u + kHalfWindow_px; ++uu) {
      const PixelStatistics& p = pixels[index(uu, vv)];
      if (!p.judged || p.changed) return {};
      const Eigen::Vector2d off = rays[index(uu, vv)].cast<double>() - center;  // small: well conditioned
      const Eigen::Vector3d row(off.x(), off.y(), 1.0);
      const double w = 1.0 / p.mean_m;
      normal += row * row.transpose();
      right += w * row;
      sum_w2 += w * w;
      variance_m2 += p.variance_m2;
    }
  }
  constexpr double kPixels = (2 * kHalfWindow_px + 1) * (2 * kHalfWindow_px + 1);
  const Eigen::Vector3d plane = normal.ldlt().solve(right);
  const double z = pixels[index(u, v)].mean_m;
  const double residual_m = z * z * std::sqrt(std::max(sum_w2 - plane.dot(right), 0.0) / kPixels);
  const double noise_m = std::sqrt(variance_m2 / kPixels / frames + steps.at(z) * steps.at(z) / 12.0);
  if (residual_m > 2.0 * noise_m + 0.002 * z) return {};  // a depth edge, or too curved
  return Eigen::Vector3d(plane.x(), plane.y(), plane.z() - plane.x() * center.x() - plane.y() * center.y());
}

NoiseSample sample_of(const PixelStatistics& pixel, const Eigen::Vector3d& plane, const Eigen::Vector2f& ray,
                      const Intrinsics& in) {
  NoiseSample sample;
  const Eigen::Vector3d r(ray.x(), ray.y(), 1.0);
  const double cosine = plane.dot(r) / (plane.norm() * r.norm());
  sample.depth_m = pixel.mean_m;
  sample.variance_m2 = pixel.variance_m2;
  sample.incidence_rad = std::acos(std::clamp(cosine, 0.0, 1.0));
  // z = 1/w, so ∂z/∂u = −z² ∂w/∂x / f.
  sample.slope_m_per_px = pixel.mean_m * pixel.mean_m * std::hypot(plane.x() / in.fx_px, plane.y() / in.fy_px);
  return sample;
}

}  // namespace

Expected<void> add_frame(PixelHistory& history, const DepthFrame& frame) {
  if (history.frames == 0) {
    history.width = frame.width;
    history.height = frame.height;
    history.metres_per_unit = frame.metres_per_unit;
    history.pixels.assign(static_cast<std::size_t>(frame.width) * static_cast<std::size_t>(frame.height), {});
    history.levels.assign(65536, 0);
  }
  if (frame.width != history.width || frame.height != history.height) {
    return tl::make_unexpected(Error::failed(fmt::format("frame {}: size {} x {}, takes {} x {}", frame.index,
                                                         frame.width, frame.height, history.width, history.height)));
  }
  ++history.frames;
  PixelSums* pixel = history.pixels.data();
  for (int v = 0; v < frame.height; ++v) {
    const std::uint16_t* const row = frame.row(v);
    for (int u = 0; u < frame.width; ++u, ++pixel) {
      const std::uint64_t value = row[u];
      if (value == 0) continue;
      ++history.levels[value];
      const std::int64_t change = static_cast<std::int64_t>(value) - pixel->last;
      if (pixel->returns > 0) pixel->squared_changes += static_cast<std::uint64_t>(change * change);
      ++pixel->returns;
      pixel->last = static_cast<std::uint16_t>(value);
      pixel->sum += value;
      pixel->sum_of_squares += value * value;
    }
  }
  return {};
}

StillScene still_scene(const PixelHistory& history, const Intrinsics& intrinsics, const RoundingSteps& steps) {
  StillScene scene;
  std::vector<PixelStatistics> pixels(history.pixels.size());
  const double needed = std::max(kReturnsShare * static_cast<double>(history.frames), 2.0);
  for (std::size_t i = 0; i < pixels.size(); ++i) {
    const double returns = history.pixels[i].returns;
    scene.seen_pixels +=
        returns > 0.0 && returns >= (1.0 - kReturnsShare) * static_cast<double>(history.frames) ? 1 : 0;
    if (returns < needed) continue;
    pixels[i] = statistics_of(history.pixels[i], history.metres_per_unit);
  }
  mark_changed(pixels, history.frames, steps);
  for (const PixelStatistics& p : pixels) {
    scene.judged_pixels += p.judged ? 1 : 0;
    scene.changed_pixels += p.changed ? 1 : 0;
  }
  const std::vector<Eigen::Vector2f> rays = ray_table(intrinsics);
  std::vector<double> correlations;
  for (int v = kHalfWindow_px; v < history.height - kHalfWindow_px; ++v) {
    for (int u = kHalfWindow_px; u < history.width - kHalfWindow_px; ++u) {
      const std::size_t i = static_cast<std::size_t>(v) * static_cast<std::size_t>(history.width) + u;
      if (!pixels[i].judged || pixels[i].changed) continue;
      const auto plane = plane_at(pixels, rays, history.width, u, v, steps, static_cast<double>(history.frames));
      if (!plane) continue;
      const NoiseSample sample = sample_of(pixels[i], *plane, rays[i], intrinsics);
      if (sample.incidence_rad > kMaxIncidence_rad) continue;
      scene.samples.push_back(sample);
      if (sample.variance_m2 > 0.0) correlations.push_back(1.0 - pixels[i].change2_m2 / sample.variance_m2);
    }
  }
  if (!correlations.empty()) {
    const auto middle = correlations.begin() + static_cast<std::ptrdiff_t>(correlations.size() / 2);
    std::nth_element(correlations.begin(), middle, correlations.end());
    scene.correlation = *middle;
  }
  return scene;
}

}  // namespace tubetrack
