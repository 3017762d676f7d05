#include "tubetrack/tracker/evidence.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <span>

#include "shape_sums.hpp"
#include "tubetrack/tracker/recycled.hpp"

namespace tubetrack {

double min_bend_radii(const TubeModel& model, const Extent& extent) {
  const double length_m = arc_length_m(model.spline, extent.t_begin, extent.t_end);
  const double t_of_radius = (extent.t_end - extent.t_begin) * model.radius_m / std::max(length_m, 1e-9);
  double sharpest = 1e-9;
  for (double t = extent.t_begin + t_of_radius; t < extent.t_end - t_of_radius; t += 0.25) {
    const Eigen::Vector3d before = point_at(model.spline, t) - point_at(model.spline, t - t_of_radius);
    const Eigen::Vector3d after = point_at(model.spline, t + t_of_radius) - point_at(model.spline, t);
    const double turn = std::atan2(before.cross(after).norm(), before.dot(after));
    sharpest = std::max(sharpest, turn * 2.0 * model.radius_m / (before.norm() + after.norm()));
  }
  return 1.0 / sharpest;
}

namespace {

constexpr std::size_t kParts = 8;  // of the length, each judged by itself

/// Where beside the tube it is looked at, in radii from the axis: rings from one border to the next.
constexpr std::array<double, 4> kRingBorders{1.1, 1.4, 1.75, 2.2};
constexpr std::size_t kRings = kRingBorders.size() - 1;

/// Medians of how far behind the axis it lies beside the tube, in radii, ring by ring for one part; kNoReturn where
/// nothing returned.
using Rings = std::array<double, kRings>;
struct Part {
  Rings rings{};
  bool straight_on = false;
};
using Beside = std::array<Part, kParts>;

constexpr double kNoReturn = 10.0;

double median_or_far(RecycledVector<double>& values) {
  if (values.size() < 3) return kNoReturn;
  const auto at = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), at, values.end());
  return std::min(*at, 0.99 * kNoReturn);
}

/// A plane tangent to the circle at angle φ passes x radii from the axis at depth (x sin φ − 1) / cos φ. Do the rings
/// lie on one such plane?
bool goes_straight_on(const Rings& rings) {
  if (rings[0] < -0.7 || rings[0] > 0.8) return false;
  double best = 10.0;
  for (double angle = 0.25; angle < 1.4; angle += 0.05) {
    double worst = 0.0;
    for (std::size_t ring = 0; ring < kRings; ++ring) {
      const double x = 0.5 * (kRingBorders[ring] + kRingBorders[ring + 1]);
      worst = std::max(worst, std::abs(rings[ring] - (x * std::sin(angle) - 1.0) / std::cos(angle)));
    }
    best = std::min(best, worst);
  }
  return best < 0.25;
}

/// On the left (sign −1) or right (+1) of the tube, from the pixels of one as thick as the outermost ring.
Beside beside(const HeightMap& map, const TubeModel& model, const Extent& extent, const PredictedPixels& wide_pixels,
              double sign) {
  std::array<std::array<RecycledVector<double>, kRings>, kParts> depths;
  for (const PredictedPixel& pixel : wide_pixels) {
    const double lateral = kRingBorders.back() * sign * pixel.lateral;
    const float measured = map.depth_m[pixel.cell];
    if (lateral < kRingBorders.front() || pixel.t < extent.t_begin || pixel.t > extent.t_end || measured <= 0.0F)
      continue;
    const double along = (pixel.t - extent.t_begin) / (extent.t_end - extent.t_begin);
    const std::size_t part = std::min(kParts - 1, static_cast<std::size_t>(along * kParts));
    const std::size_t ring = lateral < kRingBorders[1] ? 0 : lateral < kRingBorders[2] ? 1 : 2;
    depths[part][ring].push_back((measured - pixel.axis_depth_m) * pixel.across / model.radius_m);
  }
  Beside result;
  for (std::size_t part = 0; part < kParts; ++part) {
    for (std::size_t ring = 0; ring < kRings; ++ring) result[part].rings[ring] = median_or_far(depths[part][ring]);
    result[part].straight_on = goes_straight_on(result[part].rings);
  }
  return result;
}

/// Of the parts with returns on all sides asked for, the share that goes straight on along planes that run along the
/// axis. (The ground that a can stands on crosses such depths too, but only in passing.) 0 where hardly any returned.
double straight_share(std::span<const Beside> sides) {
  const auto all_sides = [&](auto&& holds) { return std::all_of(sides.begin(), sides.end(), holds); };
  int known = 0;
  int most = 0;
  for (std::size_t i = 0; i < kParts; ++i) {
    known += all_sides([&](const Beside& side) { return side[i].rings[0] < kNoReturn; }) ? 1 : 0;
    int count = 0;
    for (std::size_t j = 0; j < kParts; ++j) {
      count += all_sides([&](const Beside& side) {
        return side[i].straight_on && side[j].straight_on && std::abs(side[i].rings[0] - side[j].rings[0]) < 0.25;
      })
                   ? 1
                   : 0;
    }
    most = std::max(most, count);
  }
  return known >= 3 ? static_cast<double>(most) / known : 0.0;
}

/// How much deeper it gets beside the tube from one end to the other, in radii: the ground that a can stands on crosses
/// its axis, a box's faces run along it.
double slope_along(const Beside& beside) {
  const auto median = [](double a, double b, double c) {
    return std::max(std::min(a, b), std::min(std::max(a, b), c));
  };
  return median(beside[5].rings[0], beside[6].rings[0], beside[7].rings[0]) -
         median(beside[0].rings[0], beside[1].rings[0], beside[2].rings[0]);
}

void judge_beside(const Beside& beside, Side& side) {
  int drops = 0;
  int rises = 0;
  for (std::size_t i = 0; i < kParts; ++i) {
    drops += beside[i].rings[0] > 0.8 ? 1 : 0;
    rises += beside[i].rings[0] < 0.8 && beside[i].rings[1] < beside[i].rings[0] - 0.1 ? 1 : 0;
  }
  side.drops = 2 * drops >= static_cast<int>(kParts);
  side.rises = 2 * rises >= static_cast<int>(kParts);
}

/// Counts of pixels by how far they are from the axis: bins of a 40th of the radius, pooled along the tube.
struct SideCounts {
  static constexpr int kBins = 40;
  std::array<int, kBins> expected{};
  std::array<int, kBins> agree{};
  std::array<int, kBins> past{};
};

/// Of the left and the right side, but for where something nearer hides them: that says nothing of where they end.
std::array<SideCounts, 2> count_sides(const HeightMap& map, const TubeModel& model,
                                      const RecycledVector<Station>& stations, const Extent& extent,
                                      const PredictedPixels& predicted) {
  const auto count = static_cast<int>(stations.size());
  std::array<SideCounts, 2> sides;
  for (const PredictedPixel& pixel : predicted) {
    if (pixel.t < extent.t_begin || pixel.t > extent.t_end) continue;
    const int at = std::clamp(static_cast<int>(pixel.t / model.spline.spans() * count), 0, count - 1);
    const Station& station = stations[static_cast<std::size_t>(at)];
    if (2 * station.before > station.expected) continue;
    const float measured = map.depth_m[pixel.cell];
    if (measured < 0.0F) continue;
    const double lateral = std::abs(pixel.lateral);
    const auto bin =
        static_cast<std::size_t>(std::min(SideCounts::kBins - 1, static_cast<int>(lateral * SideCounts::kBins)));
    SideCounts& side = sides[pixel.lateral > 0.0F ? 1 : 0];
    ++side.expected[bin];
    const double off = measured - pixel.depth_m;
    if (measured > 0.0F && std::abs(off) <= agreement_m(model, pixel))
      ++side.agree[bin];
    else if (measured <= 0.0F || off > 0.0)
      ++side.past[bin];
  }
  return sides;
}

/// How far the surface agrees with the circle on one side.
Side side_of(const SideCounts& counts) {
  constexpr int kBins = SideCounts::kBins;
  const auto& [expected, agree, past] = counts;
  Side side;
  int bin = kBins;
  while (bin > 0 && 2 * agree[static_cast<std::size_t>(bin - 1)] < expected[static_cast<std::size_t>(bin - 1)]) --bin;
  side.reach_radii = static_cast<double>(bin) / kBins;
  int lost = 0;
  int lost_past = 0;
  for (int i = bin; i < kBins; ++i) {
    lost += expected[static_cast<std::size_t>(i)] - agree[static_cast<std::size_t>(i)];
    lost_past += past[static_cast<std::size_t>(i)];
  }
  side.ends = bin < kBins && 4 * lost_past > 3 * lost;
  return side;
}

constexpr int kSectionBins = 15;  // of 10° from −75° to 75°

/// Sines of the angles between bins: an arcsine for each pixel would take as long as all else.
constexpr std::array<float, kSectionBins - 1> kSectionBorders{
    -0.90630779F, -0.81915204F, -0.70710678F, -0.57357644F, -0.42261826F, -0.25881905F, -0.08715574F,
    0.08715574F,  0.25881905F,  0.42261826F,  0.57357644F,  0.70710678F,  0.81915204F,  0.90630779F};

std::size_t section_bin(float lateral) {
  const auto above = std::upper_bound(kSectionBorders.begin(), kSectionBorders.end(), lateral);
  return static_cast<std::size_t>(above - kSectionBorders.begin());
}

/// Sums over the pixels that should see a stretch of tube.
struct SurfaceSums {
  std::array<double, kSectionBins> off_m{};  ///< across the surface, of those that agree
  std::array<int, kSectionBins> hits{};      ///< that agree
  std::array<int, kSectionBins> wanted{};
  ShapeSums first_half, second_half;
  int agree = 0;
  double chi2 = 0.0;
  double depth_m = 0.0;
};

SurfaceSums sum_surface(const HeightMap& map, const TubeModel& model, const PredictedPixels& predicted,
                        const Extent& extent) {
  SurfaceSums sums;
  const double middle = 0.5 * (extent.t_begin + extent.t_end);
  for (const PredictedPixel& pixel : predicted) {
    if (pixel.cos_incidence < kCos75 || pixel.t < extent.t_begin || pixel.t > extent.t_end) continue;
    const float measured = map.depth_m[pixel.cell];
    if (measured < 0.0F) continue;
    const std::size_t at = section_bin(pixel.lateral);
    ++sums.wanted[at];
    if (measured == 0.0F) continue;
    const double off = measured - pixel.depth_m;
    add_to_shape(model, pixel, off, pixel.t < middle ? sums.first_half : sums.second_half);
    if (std::abs(off) > agreement_m(model, pixel)) continue;
    const double sigma = pixel.sigma_m;
    ++sums.agree;
    ++sums.hits[at];
    sums.off_m[at] += off * pixel.cos_incidence;
    sums.chi2 += off * off / (sigma * sigma);
    sums.depth_m += measured;
  }
  return sums;
}

/// How much of the section is seen, and how far its mean shape is off the circle.
void judge_profile(const SurfaceSums& sums, double radius_m, Evidence& evidence) {
  double squares = 0.0;
  int bins = 0;
  for (std::size_t i = 0; i < kSectionBins; ++i) {
    if (sums.hits[i] < 5 || 3 * sums.hits[i] < sums.wanted[i]) continue;
    const double mean = sums.off_m[i] / sums.hits[i] / radius_m;
    squares += mean * mean;
    ++bins;
  }
  evidence.arc_rad = bins * 10.0 / 180.0 * std::numbers::pi;
  evidence.profile_rms_radii = bins > 0 ? std::sqrt(squares / bins) : 1.0;
}

/// A cone is flatter than the mean circle at its wide end, and rounder at the other.
void judge_taper(const SurfaceSums& sums, double radius_m, Evidence& evidence) {
  const double per_length = 2.0 * radius_m / evidence.length_m;
  evidence.taper = per_length * (sums.second_half.slope() - sums.first_half.slope());
  evidence.taper_sigma = per_length * std::hypot(sums.first_half.slope_sigma(), sums.second_half.slope_sigma());
  ShapeSums shape = sums.first_half;
  shape += sums.second_half;
  evidence.flatness = shape.slope();
  evidence.flatness_sigma = shape.slope_sigma();
}

/// Where the tube is hidden it is not confirmed, but nothing speaks against it either.
double support_of(const RecycledVector<Station>& stations, const Extent& extent) {
  int agree = 0;
  int expected = 0;
  for (const Station& station : stations) {
    if (!station.seen() || station.t < extent.t_begin || station.t > extent.t_end) continue;
    agree += station.agree;
    expected += station.expected - station.anothers;
  }
  return expected > 0 ? static_cast<double>(agree) / expected : 0.0;
}

}  // namespace

Evidence surface_evidence(const HeightMap& map, const NoiseModel& noise, const TubeModel& model,
                          const PredictedPixels& predicted, const RecycledVector<Station>& stations,
                          const Extent& extent) {
  const SurfaceSums sums = sum_surface(map, model, predicted, extent);
  Evidence evidence;
  evidence.length_m = arc_length_m(model.spline, extent.t_begin, extent.t_end);
  evidence.min_bend_radii = min_bend_radii(model, extent);
  if (sums.agree == 0) return evidence;
  const auto sides = count_sides(map, model, stations, extent, predicted);
  evidence.left = side_of(sides[0]);
  evidence.right = side_of(sides[1]);
  judge_taper(sums, model.radius_m, evidence);
  evidence.support = support_of(stations, extent);
  evidence.noise_ratio = std::sqrt(sums.chi2 / sums.agree);
  const double depth_m = sums.depth_m / sums.agree;
  evidence.sigma_m = axial_sigma_m(noise, depth_m, 0.0);
  evidence.width_px = 2.0 * model.radius_m * map.intrinsics.fx_px / depth_m;
  judge_profile(sums, model.radius_m, evidence);
  return evidence;
}

void look_beside(const HeightMap& map, const NoiseModel& noise, const TubeModel& model, const Extent& extent,
                 Evidence& evidence) {
  if (evidence.is_round() && (evidence.left.ends || evidence.right.ends)) return;
  TubeModel wide = model;
  wide.radius_m = kRingBorders.back() * model.radius_m;
  for (double& offset_m : wide.profile.offset_m) offset_m *= kRingBorders.back();
  // Medians of many pixels: of a wide tube, every so manieth will do.
  const int stride = std::clamp(static_cast<int>(evidence.width_px / 12.0), 1, 4);
  thread_local PredictedPixels pixels;  // for its buffers
  predict_pixels(map, noise, wide, stride, pixels);
  const std::array<Beside, 2> both{beside(map, model, extent, pixels, -1.0), beside(map, model, extent, pixels, 1.0)};
  const auto& [left, right] = both;
  evidence.edge_share = straight_share(both);
  evidence.left.straight_share = straight_share({&left, 1});
  evidence.right.straight_share = straight_share({&right, 1});
  judge_beside(left, evidence.left);
  judge_beside(right, evidence.right);
  const double left_slope = slope_along(left);
  const double right_slope = slope_along(right);
  evidence.stands = std::min(std::abs(left_slope), std::abs(right_slope)) > 0.6 && left_slope * right_slope > 0.0;
}

Evidence gather_evidence(const HeightMap& map, const NoiseModel& noise, const TubeModel& model,
                         const PredictedPixels& predicted, const Extent& extent) {
  const auto stations = stations_of(map, model, predicted, station_length_m(map, model));
  Evidence evidence = surface_evidence(map, noise, model, predicted, stations, extent);
  if (evidence.width_px > 0.0) look_beside(map, noise, model, extent, evidence);
  return evidence;
}

}  // namespace tubetrack
