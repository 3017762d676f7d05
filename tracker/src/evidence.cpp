#include "tubetrack/tracker/evidence.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

namespace tubetrack {

namespace {

constexpr float kCos75 = 0.2588F;

double arc_length_m(const Spline& spline, double t_begin, double t_end) {
  constexpr int kSteps = 200;
  double length = 0.0;
  Eigen::Vector3d from = point_at(spline, t_begin);
  for (int i = 1; i <= kSteps; ++i) {
    const Eigen::Vector3d to = point_at(spline, t_begin + (t_end - t_begin) * i / kSteps);
    length += (to - from).norm();
    from = to;
  }
  return length;
}

/// How far a reading may stray and still be this tube's.
double agreement_m(const HeightMap& map, const NoiseModel& noise, const TubeModel& model, const PredictedPixel& pixel) {
  return 3.5 * predicted_sigma_m(map, noise, pixel) + 0.05 * model.radius_m;
}

}  // namespace

double station_length_m(const HeightMap& map, const TubeModel& model) {
  const Eigen::Vector3d middle = point_at(model.spline, 0.5 * model.spline.spans());
  return std::max(0.002, 2.0 * middle.z() / map.intrinsics.fx_px);
}

std::vector<Station> stations_of(const HeightMap& map, const NoiseModel& noise, const TubeModel& model,
                                 const std::vector<PredictedPixel>& predicted, double length_m) {
  const double spans = model.spline.spans();
  const int count = std::max(1, static_cast<int>(std::ceil(arc_length_m(model.spline, 0.0, spans) / length_m)));
  std::vector<Station> stations(static_cast<std::size_t>(count));
  for (int i = 0; i < count; ++i) stations[static_cast<std::size_t>(i)].t = (i + 0.5) * spans / count;
  for (const PredictedPixel& pixel : predicted) {
    if (pixel.cos_incidence < kCos75) continue;
    const int at = std::clamp(static_cast<int>(pixel.t / spans * count), 0, count - 1);
    Station& station = stations[static_cast<std::size_t>(at)];
    ++station.expected;
    const float measured = map.depth_m[pixel.cell];
    if (measured <= 0.0F) continue;
    const double off = measured - pixel.depth_m;
    const double allowed = agreement_m(map, noise, model, pixel);
    ++(std::abs(off) <= allowed ? station.agree : off < 0.0 ? station.before : station.behind);
  }
  return stations;
}

Extent seen_extent(const std::vector<Station>& stations, double station_m, double max_gap_m) {
  const double half = stations.size() > 1 ? 0.5 * (stations[1].t - stations[0].t) : stations.empty() ? 0.0 : stations[0].t;
  Extent best;
  int best_seen = 0;
  std::size_t i = 0;
  while (i < stations.size()) {
    if (!stations[i].seen()) {
      ++i;
      continue;
    }
    const std::size_t first = i;
    std::size_t last = i;
    int seen = 1;
    for (++i; i < stations.size() && static_cast<double>(i - last - 1) * station_m <= max_gap_m; ++i) {
      if (stations[i].refuted() && static_cast<double>(i - last) > 2.0) break;
      if (!stations[i].seen()) continue;
      last = i;
      ++seen;
    }
    i = std::max(i, last + 1);
    if (seen > best_seen) {
      best_seen = seen;
      best = {stations[first].t - half, stations[last].t + half};
    }
  }
  return best;
}

Evidence gather_evidence(const HeightMap& map, const NoiseModel& noise, const TubeModel& model,
                         const std::vector<PredictedPixel>& predicted, const Extent& extent) {
  constexpr int kBins = 15;  // of 10° from −75° to 75°
  std::array<double, kBins> sum{};
  std::array<int, kBins> hits{};
  std::array<int, kBins> wanted{};
  double chi2 = 0.0;
  int agree = 0;
  int expected = 0;
  double mean_depth = 0.0;
  for (const PredictedPixel& pixel : predicted) {
    if (pixel.cos_incidence < kCos75 || pixel.t < extent.t_begin || pixel.t > extent.t_end) continue;
    const double angle = std::asin(std::clamp(static_cast<double>(pixel.lateral), -1.0, 1.0));
    const int bin = std::clamp(static_cast<int>((angle / std::numbers::pi * 180.0 + 75.0) / 10.0), 0, kBins - 1);
    const auto at = static_cast<std::size_t>(bin);
    ++expected;
    ++wanted[at];
    const float measured = map.depth_m[pixel.cell];
    if (measured <= 0.0F) continue;
    const double off = measured - pixel.depth_m;
    if (std::abs(off) > agreement_m(map, noise, model, pixel)) continue;
    const double sigma = predicted_sigma_m(map, noise, pixel);
    ++agree;
    ++hits[at];
    sum[at] += off * pixel.cos_incidence;
    chi2 += off * off / (sigma * sigma);
    mean_depth += measured;
  }
  Evidence evidence;
  evidence.length_m = arc_length_m(model.spline, extent.t_begin, extent.t_end);
  if (agree == 0) return evidence;
  evidence.support = static_cast<double>(agree) / expected;
  evidence.noise_ratio = std::sqrt(chi2 / agree);
  evidence.width_px = 2.0 * model.radius_m * map.intrinsics.fx_px / (mean_depth / agree);
  double squares = 0.0;
  int bins = 0;
  for (std::size_t i = 0; i < kBins; ++i) {
    if (hits[i] < 5 || 3 * hits[i] < wanted[i]) continue;
    const double mean = sum[i] / hits[i] / model.radius_m;
    squares += mean * mean;
    ++bins;
  }
  evidence.arc_rad = bins * 10.0 / 180.0 * std::numbers::pi;
  evidence.profile_rms_radii = bins > 0 ? std::sqrt(squares / bins) : 1.0;
  return evidence;
}

}  // namespace tubetrack
