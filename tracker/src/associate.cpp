#include "tubetrack/tracker/associate.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <tuple>

namespace tubetrack {

namespace {

constexpr int kMaxFramesAway = 30;

double distance_to_polyline_m(const Eigen::Vector3d& point, const std::vector<Eigen::Vector3d>& line) {
  double best = std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i + 1 < line.size(); ++i) {
    const Eigen::Vector3d along = line[i + 1] - line[i];
    const double s = std::clamp((point - line[i]).dot(along) / std::max(along.squaredNorm(), 1e-18), 0.0, 1.0);
    best = std::min(best, (point - line[i] - s * along).norm());
  }
  return best;
}

}  // namespace

double centerline_distance_m(const Tube& a, const Tube& b) {
  if (a.centerline_m.empty() || b.centerline_m.size() < 2) return std::numeric_limits<double>::infinity();
  double sum = 0.0;
  for (const Eigen::Vector3d& point : a.centerline_m) sum += distance_to_polyline_m(point, b.centerline_m);
  return sum / static_cast<double>(a.centerline_m.size());
}

void associate(Identities& identities, std::vector<Tube>& tubes) {
  std::vector<std::tuple<double, std::size_t, std::size_t>> pairs;  // distance, known, new
  for (std::size_t k = 0; k < identities.known.size(); ++k) {
    const Tube& known = identities.known[k].tube;
    for (std::size_t i = 0; i < tubes.size(); ++i) {
      // The shorter line decides: a tube half hidden is still the same tube.
      const double distance = std::min(centerline_distance_m(known, tubes[i]), centerline_distance_m(tubes[i], known));
      const bool alike =
          std::abs(known.radius_m - tubes[i].radius_m) < 0.25 * std::max(known.radius_m, tubes[i].radius_m);
      if (alike && distance < 2.0 * known.radius_m) pairs.emplace_back(distance, k, i);
    }
  }
  std::sort(pairs.begin(), pairs.end());
  std::vector<bool> known_taken(identities.known.size(), false);
  std::vector<bool> tube_taken(tubes.size(), false);
  for (const auto& [distance, k, i] : pairs) {
    if (known_taken[k] || tube_taken[i]) continue;
    known_taken[k] = tube_taken[i] = true;
    tubes[i].id = identities.known[k].tube.id;
    identities.known[k] = {tubes[i], 0};
  }
  for (std::size_t k = 0; k < known_taken.size(); ++k) identities.known[k].frames_away += known_taken[k] ? 0 : 1;
  std::erase_if(identities.known, [](const Identities::Known& known) { return known.frames_away > kMaxFramesAway; });
  for (std::size_t i = 0; i < tubes.size(); ++i) {
    if (tube_taken[i]) continue;
    tubes[i].id = identities.next_id++;
    identities.known.push_back({tubes[i], 0});
  }
}

}  // namespace tubetrack
