#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "scan_evidence.hpp"
#include "scan_section.hpp"

namespace tubetrack {

inline constexpr double kStationRadii = 0.5;

struct Sections {
  std::vector<std::uint64_t> by_place, by_normal;  // one a station
  std::vector<double> agreeing;                    // how many surfels
  std::vector<std::uint32_t> places;               // of the points that agree: kBins · station + bin, else kNowhere
};
inline constexpr std::uint32_t kNowhere = 0xFFFFFFFF;

/// What is looked at, and how.
struct Look {
  std::span<const CellSurfel> surfels;
  const std::vector<SurfacePoint>& points;
  double per_point = 1.0;  ///< surfels that each stands for
  double radius_m = 0.0;
  double agree_m = 0.0;        ///< how far off a surfel that agrees is at most
  double station_spans = 0.0;  ///< from one to the next
  double stations_per_span = 0.0;
  std::vector<SectionAxes> axes;  ///< of the stations
};

Look look_along(std::span<const CellSurfel> surfels, const std::vector<SurfacePoint>& points, std::size_t every,
                const ScanLine& line, double scale_m, const std::vector<ScanStation>& stations);

/// Sorts the points into the stations, and those that agree into the sections' bins.
Sections gather(const Look& look, double spacing_m, std::vector<ScanStation>& stations);

/// How much of its section is seen at each station, and whether that suffices.
void set_arcs(const Sections& sections, double min_arc_rad, std::vector<ScanStation>& stations);

/// First and last station of the run with the most seen ones; (1, 0) for none.
std::pair<std::size_t, std::size_t> best_run(const std::vector<ScanStation>& stations);

}  // namespace tubetrack
