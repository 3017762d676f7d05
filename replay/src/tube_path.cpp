#include "tubetrack/replay/tube_path.hpp"

#include <algorithm>
#include <cmath>

namespace tubetrack {

std::vector<PlacedPart> place_parts(const SceneTube& tube) {
  std::vector<PlacedPart> placed;
  CenterlinePoint at{tube.start_m, tube.direction.normalized()};
  Eigen::Vector3d towards = (tube.bend_direction - tube.bend_direction.dot(at.tangent) * at.tangent).normalized();
  double from_m = 0.0;
  for (const TubePart& part : tube.parts) {
    PlacedPart next;
    next.type = part.type;
    next.from_m = from_m;
    next.start_m = at.position_m;
    next.tangent = at.tangent;
    if (part.type == TubePart::Type::arc) {
      towards = Eigen::AngleAxisd(part.rotation_rad, at.tangent) * towards;
      next.bend_radius_m = part.bend_radius_m;
      next.length_m = part.bend_radius_m * part.angle_rad;
    } else {
      next.length_m = part.length_m;
    }
    next.towards = towards;
    at = point_on_part(next, next.length_m);
    if (part.type == TubePart::Type::arc) {  // the bend's plane goes on, so `towards` turns with the tangent
      towards = std::cos(part.angle_rad) * next.towards - std::sin(part.angle_rad) * next.tangent;
    }
    from_m += next.length_m;
    placed.push_back(next);
  }
  return placed;
}

CenterlinePoint point_on_part(const PlacedPart& part, double along_m) {
  if (part.type == TubePart::Type::straight) return {part.start_m + along_m * part.tangent, part.tangent};
  const double angle = along_m / part.bend_radius_m;
  const Eigen::Vector3d offset = std::sin(angle) * part.tangent + (1.0 - std::cos(angle)) * part.towards;
  return {part.start_m + part.bend_radius_m * offset, std::cos(angle) * part.tangent + std::sin(angle) * part.towards};
}

double radius_along_m(const SceneTube& tube, double along_m) {
  const std::vector<RadiusKey>& keys = tube.radius_profile;
  if (keys.empty()) return tube.radius_m;
  const auto after = std::find_if(keys.begin(), keys.end(), [&](const RadiusKey& key) { return key.at_m > along_m; });
  if (after == keys.begin()) return keys.front().radius_m;
  if (after == keys.end()) return keys.back().radius_m;
  const RadiusKey& before = after[-1];
  return before.radius_m + (after->radius_m - before.radius_m) * (along_m - before.at_m) / (after->at_m - before.at_m);
}

double largest_radius_m(const SceneTube& tube) {
  if (tube.radius_profile.empty()) return tube.radius_m;
  return std::ranges::max(tube.radius_profile, {}, &RadiusKey::radius_m).radius_m;
}

double mean_radius_m(const SceneTube& tube) {
  if (tube.radius_profile.empty()) return tube.radius_m;
  constexpr int kSteps = 1000;
  const double length_m = total_length_m(place_parts(tube));
  double sum_m = 0.0;
  for (int i = 0; i < kSteps; ++i) sum_m += radius_along_m(tube, length_m * (i + 0.5) / kSteps);
  return sum_m / kSteps;
}

double total_length_m(const std::vector<PlacedPart>& parts) {
  return parts.empty() ? 0.0 : parts.back().from_m + parts.back().length_m;
}

std::vector<CenterlinePoint> sample_centerline(const std::vector<PlacedPart>& parts, double step_m) {
  std::vector<CenterlinePoint> samples;
  const double length_m = total_length_m(parts);
  std::size_t part = 0;
  for (int i = 0; i * step_m < length_m - 1e-9; ++i) {
    const double along_m = i * step_m;
    while (part + 1 < parts.size() && along_m >= parts[part + 1].from_m) ++part;
    samples.push_back(point_on_part(parts[part], along_m - parts[part].from_m));
  }
  if (!parts.empty()) samples.push_back(point_on_part(parts.back(), parts.back().length_m));
  return samples;
}

}  // namespace tubetrack
