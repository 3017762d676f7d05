#include "tubetrack/report/bend_errors.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace tubetrack {

namespace {

constexpr double kRad = std::numbers::pi / 180.0;

/// The same bends, met from the other end: the turn between two planes is right-handed either way.
std::vector<TrueBend> from_the_other_end(const std::vector<TrueBend>& bends) {
  std::vector<TrueBend> reversed(bends.rbegin(), bends.rend());
  for (std::size_t i = reversed.size(); i-- > 1;) reversed[i].rotation_rad = reversed[i - 1].rotation_rad;
  return reversed;
}

bool asked_for(const TrueBend& bend, double tube_radius_m) {
  return bend.angle_rad >= 45.0 * kRad && bend.angle_rad <= 150.0 * kRad && bend.bend_radius_m >= 5.0 * tube_radius_m &&
         bend.bend_radius_m * bend.angle_rad >= 0.06;
}

double angle_between(double a_rad, double b_rad) {
  return std::abs(std::remainder(a_rad - b_rad, 2.0 * std::numbers::pi));
}

BendErrors errors_of(const std::vector<TrueBend>& bends, const std::vector<BendRow>& rows, double tube_radius_m) {
  BendErrors errors;
  for (std::size_t i = 0; i < bends.size(); ++i) {
    if (!asked_for(bends[i], tube_radius_m)) continue;
    errors.angle_rad.push_back(std::abs(rows[i].angle_rad - bends[i].angle_rad));
    errors.bend_radius_relative.push_back(std::abs(rows[i].bend_radius_m / bends[i].bend_radius_m - 1.0));
    if (i == 0 || !asked_for(bends[i - 1], tube_radius_m)) continue;
    errors.rotation_rad.push_back(angle_between(rows[i].rotation_rad, bends[i].rotation_rad));
  }
  return errors;
}

double sum_of(const BendErrors& errors) {
  double sum = 0.0;
  for (const auto* values : {&errors.angle_rad, &errors.bend_radius_relative, &errors.rotation_rad}) {
    for (const double value : *values) sum += value;
  }
  return sum;
}

/// The reported tube whose middle lies in the true one; null where there is none.
const Tube* reported(const TrueTube& truth, const TubeFrame& result) {
  for (const Tube& tube : result.tubes) {
    if (tube.centerline_m.empty()) continue;
    const Eigen::Vector3d& middle = tube.centerline_m[tube.centerline_m.size() / 2];
    if (std::ranges::any_of(truth.centerline_m,
                            [&](const Eigen::Vector3d& point) { return (point - middle).norm() < truth.radius_m; }))
      return &tube;
  }
  return nullptr;
}

template <class T>
void append(std::vector<T>& to, const std::vector<T>& from) {
  to.insert(to.end(), from.begin(), from.end());
}

}  // namespace

void add(BendErrors& sum, const BendErrors& part) {
  sum.tubes += part.tubes;
  sum.tubes_right += part.tubes_right;
  append(sum.angle_rad, part.angle_rad);
  append(sum.bend_radius_relative, part.bend_radius_relative);
  append(sum.rotation_rad, part.rotation_rad);
}

BendErrors bend_errors(const TruthFrame& truth, const TubeFrame& result) {
  BendErrors all;
  for (const TrueTube& true_tube : truth.tubes) {
    const std::vector<TrueBend>& bends = true_tube.bends;
    const Tube* tube = bends.empty() ? nullptr : reported(true_tube, result);
    if (tube == nullptr) continue;
    ++all.tubes;
    const std::vector<BendRow>& rows = tube->bend_table.lra;
    if (rows.size() != bends.size() + 1) continue;
    ++all.tubes_right;
    const BendErrors there = errors_of(bends, rows, true_tube.radius_m);
    const BendErrors back = errors_of(from_the_other_end(bends), rows, true_tube.radius_m);
    add(all, sum_of(there) <= sum_of(back) ? there : back);
  }
  return all;
}

}  // namespace tubetrack
