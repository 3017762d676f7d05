#pragma once

#include <cstddef>
#include <vector>

namespace tubetrack {

/// Into so many parts a section is cut to see how sure an end is.
constexpr int kEndSectors = 6;

/// A surfel's place along the line, its weight, and which part of the section it is in, 0 … kEndSectors − 1.
struct PlacedArea {
  double t = 0.0;
  double weight = 0.0;
  int sector = 0;
};

/// Where a tube ends, and how sure that is: by how much the parts of its section differ in it. In knots of the line.
struct TubeEnd {
  double t = 0.0;
  double sigma = 0.0;  ///< 0 where fewer than three parts tell
};

/// Where the surface ends. The outermost surfels (but for one in a hundred) do so a part of their size before it does;
/// how much, their areas tell: summed up from the end on, they grow with the way from it. `areas` are those of the last
/// two radii, not empty; `outer` of them are in the last radius, `front` says that the tube is at larger t, and surfels
/// are `spacing` apart.
TubeEnd end_of(std::vector<PlacedArea> areas, std::size_t outer, bool front, double spacing);

}  // namespace tubetrack
