#include "scan_evidence.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "scan_ends.hpp"
#include "scan_section.hpp"
#include "scan_stations.hpp"

namespace tubetrack {

namespace {

struct RadiusSums {
  double count = 0.0, sum = 0.0, squares = 0.0;

  void add(double radius_m) {
    count += 1.0;
    sum += radius_m;
    squares += radius_m * radius_m;
  }
};

/// Where the tube ends, by the surfels of the four stations (2 radii) from `station` on.
TubeEnd end_at(const Look& look, const Sections& sections, std::size_t station, bool front, double spacing_spans) {
  constexpr std::uint32_t kStations = 4, kOuter = 2;
  std::vector<PlacedArea> outer, inner;
  const auto end = static_cast<std::uint32_t>(station);
  for (std::size_t i = 0; i < look.points.size(); ++i) {
    const std::uint32_t place = sections.places[i], at = place / kBins;
    const std::uint32_t inward = front ? at - end : end - at;  // wraps to a large number beyond the end
    if (inward >= kStations || place == kNowhere) continue;
    const SurfacePoint& point = look.points[i];
    (inward < kOuter ? outer : inner)
        .push_back({point.t, look.surfels[point.surfel].weight, static_cast<int>(place % kBins) * kEndSectors / kBins});
  }
  if (outer.empty() && inner.empty()) return {look.station_spans * static_cast<double>(front ? station : station + 1)};
  const std::size_t outermost = outer.size();
  outer.insert(outer.end(), inner.begin(), inner.end());
  return end_of(std::move(outer), outermost, front, spacing_spans);
}

/// Sums over the bins of a section, pooled along stretches of four radii (a section that turns along a long tube would
/// be smeared out) or as many more as it takes to have enough surfels.
std::vector<std::array<RadiusSums, kBins>> pooled_bins(const Look& look, const Sections& sections, std::size_t first,
                                                       std::size_t last) {
  constexpr std::size_t kPooled = 8;
  constexpr double kEnough = 8.0 * kBins;
  std::vector<std::uint32_t> pool_of;  // of the stations from the first on
  std::uint32_t pool = 0;
  double agreeing = 0.0;
  for (std::size_t at = first, begin = first; at <= last; ++at) {
    if (at >= begin + kPooled && agreeing >= kEnough) {
      ++pool;
      begin = at;
      agreeing = 0.0;
    }
    agreeing += sections.agreeing[at];
    pool_of.push_back(pool);
  }
  std::vector<std::array<RadiusSums, kBins>> pools(pool + 1);
  for (std::size_t i = 0; i < look.points.size(); ++i) {
    const std::uint32_t place = sections.places[i];
    const std::size_t at = place / kBins - first;  // wraps to a large number before the first
    if (place != kNowhere && at < pool_of.size()) pools[pool_of[at]][place % kBins].add(look.points[i].distance_m);
  }
  return pools;
}

/// RMS of the section's shape against its mean; less what the scatter within the bins adds.
double profile_rms(const Look& look, const Sections& sections, std::size_t first, std::size_t last) {
  double sum = 0.0, count = 0.0;
  for (const std::array<RadiusSums, kBins>& bins : pooled_bins(look, sections, first, last)) {
    double pooled = 0.0, filled = 0.0, mean_m = 0.0, scatter = 0.0;
    for (const RadiusSums& bin : bins) {
      if (!(bin.count > 0.0)) continue;
      pooled += bin.count;
      filled += 1.0;
      mean_m += bin.sum / bin.count;
      scatter += std::max(0.0, bin.squares - bin.sum * bin.sum / bin.count);
    }
    if (!(filled > 0.0)) continue;
    mean_m /= filled;
    const double variance = scatter / std::max(1.0, pooled - filled);
    for (const RadiusSums& bin : bins) {
      if (!(bin.count > 0.0)) continue;
      const double off = bin.sum / bin.count - mean_m;
      sum += (off * off - variance / bin.count) / (mean_m * mean_m);
      count += 1.0;
    }
  }
  return count > 0.0 ? std::sqrt(std::max(0.0, sum / count)) : 0.0;
}

double taper_of(const std::vector<ScanStation>& stations, std::size_t first, std::size_t last, double station_m) {
  double n = 0.0, sx = 0.0, sy = 0.0, sxx = 0.0, sxy = 0.0;
  for (std::size_t i = first; i <= last; ++i) {
    if (!(stations[i].radius_m > 0.0) || !stations[i].seen) continue;
    const double x = station_m * static_cast<double>(i), y = stations[i].radius_m;
    n += 1.0, sx += x, sy += y, sxx += x * x, sxy += x * y;
  }
  const double spread = sxx - (n > 0.0 ? sx * sx / n : 0.0);
  return n > 2.0 && spread > 0.0 ? (sxy - sx * sy / n) / spread : 0.0;
}

double length_between(const Spline& spline, double t_begin, double t_end) {
  const int pieces = std::max(1, static_cast<int>(std::ceil(8.0 * (t_end - t_begin))));
  double length_m = 0.0;
  Eigen::Vector3d last_m = point_at(spline, t_begin);
  for (int i = 1; i <= pieces; ++i) {
    const Eigen::Vector3d point_m = point_at(spline, t_begin + (t_end - t_begin) * i / pieces);
    length_m += (point_m - last_m).norm();
    last_m = point_m;
  }
  return length_m;
}

/// The seen stretch: from the first station of the run to its last, to where the surface ends.
void set_stretch(const Look& look, const Sections& sections, std::size_t first, std::size_t last, const ScanLine& line,
                 double spacing_m, ScanEvidence& evidence) {
  const Spline& spline = line.model.spline;
  const double span_m = length_between(spline, 0.0, spline.spans()) / spline.spans();
  const TubeEnd begin = end_at(look, sections, first, true, spacing_m / span_m),
                end = end_at(look, sections, last, false, spacing_m / span_m);
  evidence.t_begin = std::max(0.0, begin.t);
  evidence.t_end = std::min(spline.spans(), end.t);
  evidence.begin_sigma_m = begin.sigma * span_m;
  evidence.end_sigma_m = end.sigma * span_m;
  if (line.closed() && first <= static_cast<std::size_t>(line.overlap / look.station_spans) &&
      evidence.t_end >= line.overlap + line.period - look.station_spans) {
    evidence.t_begin = line.overlap;
    evidence.t_end = line.overlap + line.period;
  }
  evidence.t_end = std::max(evidence.t_begin, evidence.t_end);
  evidence.length_m = length_between(spline, evidence.t_begin, evidence.t_end);
}

/// Arc and support over the stations of a run.
void sum_up(std::size_t first, std::size_t last, ScanEvidence& evidence) {
  std::vector<double> arcs;
  double agree = 0.0, facing = 0.0;
  for (std::size_t i = first; i <= last; ++i) {
    arcs.push_back(evidence.stations[i].arc_rad);
    agree += evidence.stations[i].agree;
    facing += evidence.stations[i].facing;
  }
  std::nth_element(arcs.begin(), arcs.begin() + static_cast<std::ptrdiff_t>(arcs.size() / 2), arcs.end());
  evidence.arc_rad = arcs[arcs.size() / 2];
  evidence.support = agree / facing;
}

}  // namespace

ScanEvidence look_at(std::span<const CellSurfel> surfels, const std::vector<SurfacePoint>& points, std::size_t every,
                     const ScanLine& line, double spacing_m, double scale_m, double min_arc_rad) {
  ScanEvidence evidence;
  const Spline& spline = line.model.spline;
  const double radius_m = line.model.radius_m;
  const double line_m = length_between(spline, 0.0, spline.spans());
  const auto count = static_cast<std::size_t>(std::max(2.0, std::ceil(line_m / (kStationRadii * radius_m))));
  const double station_spans = spline.spans() / static_cast<double>(count);
  evidence.stations.resize(count);
  for (std::size_t i = 0; i < count; ++i) evidence.stations[i].t = (static_cast<double>(i) + 0.5) * station_spans;
  const Look look = look_along(surfels, points, every, line, scale_m, evidence.stations);
  const double apart_m = spacing_m * std::sqrt(look.per_point);
  const Sections sections = gather(look, apart_m, evidence.stations);
  set_arcs(sections, min_arc_rad, evidence.stations);
  const auto [first, last] = best_run(evidence.stations);
  if (first > last) return evidence;
  set_stretch(look, sections, first, last, line, apart_m, evidence);
  sum_up(first, last, evidence);
  evidence.spacing_radii = spacing_m / radius_m;
  evidence.scale_radii = scale_m / radius_m;
  evidence.profile_rms_radii = profile_rms(look, sections, first, last);
  evidence.taper = taper_of(evidence.stations, first, last, line_m / static_cast<double>(count));
  return evidence;
}

void look_at_ends(std::span<const ScanSurfel> surfels, const ScanLine& line, double spacing_m, double scale_m,
                  double min_arc_rad, ScanEvidence& evidence) {
  auto [first, last] = best_run(evidence.stations);
  if (first > last) return;
  // Four stations inward, and as far again from the line as points_near looks.
  const double reach_m = 4.0 * line.model.radius_m;
  const Eigen::Vector3f begin_m = point_at(line.model.spline, evidence.t_begin).cast<float>();
  const Eigen::Vector3f end_m = point_at(line.model.spline, evidence.t_end).cast<float>();
  const auto reach_m2 = static_cast<float>(reach_m * reach_m);
  std::vector<ScanSurfel> near;
  for (const ScanSurfel& surfel : surfels) {
    if ((surfel.position_m - begin_m).squaredNorm() < reach_m2 || (surfel.position_m - end_m).squaredNorm() < reach_m2)
      near.push_back(surfel);
  }
  // Hardly any of them is taken together with another.
  constexpr double kApart = 0.05;
  const SurfelGrid grid = merged_by_cell(near, {}, kApart * spacing_m);
  const std::vector<SurfacePoint> points = points_near(grid, {}, line);
  const Look look = look_along(grid.surfels, points, 1, line, scale_m, evidence.stations);
  // The last surfels may lie in a station that the means of cells were not in.
  std::vector<ScanStation> stations(evidence.stations.size());
  const Sections sections = gather(look, spacing_m, stations);
  set_arcs(sections, min_arc_rad, stations);
  if (first > 0 && stations[first - 1].seen) --first;
  if (last + 1 < stations.size() && stations[last + 1].seen) ++last;
  set_stretch(look, sections, first, last, line, spacing_m, evidence);
}

bool is_certain(const ScanEvidence& evidence) {
  constexpr double kAgree = 0.9, kScatterRadii = 0.02, kScatterSpacings = 0.4;
  return evidence.support > kAgree &&
         evidence.scale_radii < std::max(kScatterRadii, kScatterSpacings * evidence.spacing_radii);
}

std::optional<std::string> why_no_scan_tube(const ScanEvidence& evidence, double radius_m,
                                            const ScanTubesConfig& config) {
  constexpr double kLeastSupport = 0.6, kMostTaper = 0.08;
  // Where normals point all around the section may be an oval, as a vessel's is (axes 1 : 1.5); those of a square bar
  // point four ways. A section of few flat sides stands off the circle, and one of few points is uneven.
  constexpr double kMostOval = 0.15, kMostOutOfRound = 0.07, kMostFlat = 0.08;
  const double sides = std::min(kMostFlat, 0.25 * evidence.spacing_radii);
  const bool all_around = evidence.arc_rad > kAllAround_rad;
  const double out_of_round = all_around ? kMostOval : kMostOutOfRound + sides;
  if (evidence.length_m < config.min_length_radii * radius_m)
    return fmt::format("{:.4f} m long, less than {} radii", evidence.length_m, config.min_length_radii);
  if (evidence.arc_rad < config.min_arc_rad) return fmt::format("{:.2f} rad of its section seen", evidence.arc_rad);
  if (evidence.support < kLeastSupport) return fmt::format("{:.2f} of the surface agrees", evidence.support);
  if (evidence.profile_rms_radii > out_of_round)
    return fmt::format("{:.3f} radii out of round", evidence.profile_rms_radii);
  // A true surface scatters less than its surfels are apart; what scatters more may be anything that is round by and
  // large.
  constexpr double kMostScatter = 0.04, kOvalSpacings = 1.2;
  const double spacings = (all_around ? kOvalSpacings : 1.0) * evidence.spacing_radii;
  if (evidence.scale_radii > std::max(kMostScatter, spacings))
    return fmt::format("scatters by {:.3f} radii", evidence.scale_radii);
  if (std::abs(evidence.taper) > kMostTaper) return fmt::format("tapers by {:.3f}", evidence.taper);
  return std::nullopt;
}

}  // namespace tubetrack
