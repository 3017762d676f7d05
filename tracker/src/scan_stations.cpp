#include "scan_stations.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <bit>
#include <cmath>
#include <utility>

namespace tubetrack {

namespace {

constexpr double kAgreeRadii = 0.2, kMostAgreeRadii = 0.25, kAgreeSigmas = 3.0;
constexpr double kAgreeFacing = 0.85;  // 32°
constexpr double kUnseenRadii = 3.0;

/// Axes across the line at each station, carried along without a turn.
std::vector<SectionAxes> frames_along(const Spline& spline, const std::vector<ScanStation>& stations) {
  std::vector<SectionAxes> frames;
  Eigen::Vector3d e1 = Eigen::Vector3d::Zero();
  for (const ScanStation& station : stations) {
    const Eigen::Vector3d along = derivative_at(spline, station.t).normalized();
    e1 -= e1.dot(along) * along;
    e1 = e1.norm() > 1e-3 ? Eigen::Vector3d(e1.normalized()) : Eigen::Vector3d(along.unitOrthogonal());
    frames.push_back({e1.cast<float>(), along.cross(e1).cast<float>()});
  }
  return frames;
}

std::size_t station_of(const Look& look, const SurfacePoint& point) {
  return std::min(static_cast<std::size_t>(point.t * look.stations_per_span), look.axes.size() - 1);
}

bool agrees(const Look& look, const SurfacePoint& point) {
  return std::abs(static_cast<double>(point.distance_m) - look.radius_m) <= look.agree_m &&
         static_cast<double>(point.inward.dot(look.surfels[point.surfel].inward_normal)) >= kAgreeFacing;
}

}  // namespace

Look look_along(std::span<const CellSurfel> surfels, const std::vector<SurfacePoint>& points, std::size_t every,
                const ScanLine& line, double scale_m, const std::vector<ScanStation>& stations) {
  const double radius_m = line.model.radius_m;
  const auto count = static_cast<double>(stations.size());
  return {surfels,
          points,
          static_cast<double>(every),
          radius_m,
          std::clamp(kAgreeSigmas * scale_m, kAgreeRadii * radius_m, kMostAgreeRadii * radius_m),
          line.model.spline.spans() / count,
          count / line.model.spline.spans(),
          frames_along(line.model.spline, stations)};
}

Sections gather(const Look& look, double spacing_m, std::vector<ScanStation>& stations) {
  const std::size_t count = stations.size();
  Sections sections;
  sections.by_place.resize(count);
  sections.by_normal.resize(count);
  sections.agreeing.resize(count);
  sections.places.resize(look.points.size(), kNowhere);
  const auto half_rad = static_cast<float>(std::min(0.75 * spacing_m / look.radius_m, 0.4));
  for (std::size_t i = 0; i < look.points.size(); ++i) {
    const SurfacePoint& point = look.points[i];
    const std::size_t at = station_of(look, point);
    const CellSurfel& surfel = look.surfels[point.surfel];
    const double weight = look.per_point * static_cast<double>(surfel.weight);
    stations[at].facing += weight;
    if (!agrees(look, point)) continue;
    stations[at].agree += weight;
    stations[at].radius_m += weight * static_cast<double>(point.distance_m);
    const float place_rad = angle_of(-point.inward, look.axes[at]);
    sections.by_place[at] |= bins_around(place_rad, half_rad);
    sections.by_normal[at] |= bins_around(angle_of(-surfel.inward_normal, look.axes[at]), half_rad);
    sections.places[i] = static_cast<std::uint32_t>(kBins * at) + static_cast<std::uint32_t>(bin_of(place_rad));
    sections.agreeing[at] += 1.0;
  }
  for (ScanStation& station : stations) {
    if (station.agree > 0.0) station.radius_m /= station.agree;
  }
  return sections;
}

void set_arcs(const Sections& sections, double min_arc_rad, std::vector<ScanStation>& stations) {
  for (std::size_t i = 0; i < stations.size(); ++i) {
    std::uint64_t places = 0, normals = 0;
    for (std::size_t k = i > 0 ? i - 1 : 0; k <= std::min(i + 1, stations.size() - 1); ++k) {
      places |= sections.by_place[k];
      normals |= sections.by_normal[k];
    }
    stations[i].arc_rad = kBin_rad * std::min(std::popcount(places), std::popcount(normals));
    stations[i].seen = stations[i].agree > 0.0 && stations[i].arc_rad >= min_arc_rad;
  }
}

std::pair<std::size_t, std::size_t> best_run(const std::vector<ScanStation>& stations) {
  const auto max_gap = static_cast<std::size_t>(kUnseenRadii / kStationRadii);
  std::pair<std::size_t, std::size_t> best{1, 0}, run{1, 0};
  int best_count = 0, count = 0;
  for (std::size_t i = 0; i < stations.size(); ++i) {
    if (!stations[i].seen) continue;
    if (count == 0 || i - run.second > max_gap + 1) {
      run = {i, i};
      count = 0;
    }
    run.second = i;
    if (++count > best_count) {
      best_count = count;
      best = run;
    }
  }
  return best;
}

}  // namespace tubetrack
