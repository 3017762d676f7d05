#include "scan_ends.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>

namespace tubetrack {

namespace {

/// Least squares of places over areas summed up from the end on: the place where the area is 0.
struct AreaLine {
  double area = 0.0, n = 0.0, sx = 0.0, sy = 0.0, sxx = 0.0, sxy = 0.0;

  void add(double place, double weight) {
    const double x = area + 0.5 * weight;
    area += weight;
    n += weight, sx += weight * x, sy += weight * place;
    sxx += weight * x * x, sxy += weight * x * place;
  }
  std::optional<double> start() const {
    const double spread = n * sxx - sx * sx;
    if (!(spread > 0.0)) return std::nullopt;
    return (sy * sxx - sx * sxy) / spread;
  }
};

}  // namespace

TubeEnd end_of(std::vector<PlacedArea> areas, std::size_t outer, bool front, double spacing) {
  const double inward = front ? 1.0 : -1.0;
  std::sort(areas.begin(), areas.end(), [inward](const PlacedArea& a, const PlacedArea& b) {
    return inward * a.t < inward * b.t || (a.t == b.t && a.weight < b.weight);
  });
  const double outermost = areas[std::min(outer / 100, outer - 1)].t;
  AreaLine whole;
  std::array<AreaLine, kEndSectors> parts;
  for (const PlacedArea& placed : areas) {
    whole.add(placed.t - outermost, placed.weight);
    parts[static_cast<std::size_t>(placed.sector)].add(placed.t - outermost, placed.weight);
  }
  TubeEnd end{outermost, 0.0};
  if (const auto start = whole.start()) end.t -= inward * std::clamp(-inward * *start, 0.0, spacing);
  double count = 0.0, sum = 0.0, squares = 0.0;
  for (const AreaLine& part : parts) {
    // A part that holds little of the section, at the rim of what is seen, says nothing.
    const auto start = part.area > whole.area / (4.0 * kEndSectors) ? part.start() : std::nullopt;
    if (!start) continue;
    count += 1.0, sum += *start, squares += *start * *start;
  }
  constexpr double kLeastParts = 3.0;
  if (count >= kLeastParts) end.sigma = std::sqrt(std::max(0.0, squares - sum * sum / count) / (count * (count - 1.0)));
  return end;
}

}  // namespace tubetrack
