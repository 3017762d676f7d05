#include "followed_extent.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "drift.hpp"
#include "motion.hpp"
#include "tubetrack/tracker/recycled.hpp"

namespace tubetrack {

namespace {

/// Something nearer hides it.
bool covered(const Station& station) {
  return 2 * station.before > station.expected;
}

/// A matrix over control points and radius, with so many control points more (or, below 0, fewer) at either end; new
/// ones get `diagonal`.
RecycledMatrix resized(const RecycledMatrix& matrix, int front, int back, double diagonal) {
  if (matrix.rows() == 0) return matrix;
  const Eigen::Index size = matrix.rows() + 3 * (front + back);
  const Eigen::Index from = 3 * std::max(0, -front);
  const Eigen::Index to = 3 * std::max(0, front);
  const Eigen::Index kept = std::min(matrix.rows() - 1 - from, size - 1 - to);
  RecycledMatrix result = Eigen::MatrixXd::Zero(size, size);
  result.diagonal().setConstant(diagonal);
  result.block(to, to, kept, kept) = matrix.block(from, from, kept, kept);
  result.block(to, size - 1, kept, 1) = matrix.block(from, matrix.cols() - 1, kept, 1);
  result.block(size - 1, to, 1, kept) = matrix.block(matrix.rows() - 1, from, 1, kept);
  result(size - 1, size - 1) = matrix(matrix.rows() - 1, matrix.cols() - 1);
  return result;
}

/// What is dropped is from now on where `parameters` have it: the vector is of absolute places, so what the information
/// says of the others given those must go over into it.
Information resized(const Information& information, const RecycledColumn& parameters, int front, int back) {
  Information result{resized(information.matrix, front, back, 0.0), {}};
  result.vector = Eigen::VectorXd::Zero(result.matrix.rows());
  if (information.vector.size() == 0) return result;
  const Eigen::Index last = parameters.size() - 1;
  const Eigen::Index from = 3 * std::max(0, -front);
  const Eigen::Index to = 3 * std::max(0, front);
  const Eigen::Index kept = std::min(last - from, result.vector.size() - 1 - to);
  const Eigen::Index behind = last - from - kept;
  RecycledColumn old = information.vector;
  old.noalias() -= information.matrix.leftCols(from) * parameters.head(from);
  old.noalias() -= information.matrix.middleCols(from + kept, behind) * parameters.segment(from + kept, behind);
  result.vector.segment(to, kept) = old.segment(from, kept);
  result.vector[result.vector.size() - 1] = old[old.size() - 1];
  return result;
}

}  // namespace

bool agrees(const Station& station) {
  const int own = station.expected - station.anothers;
  return 3 * own > station.expected && 2 * station.agree >= own;
}

bool hidden(const Station& station) {
  const int unseen = station.expected - station.agree - station.before - station.behind;
  return station.expected == 0 || 2 * (station.before + unseen) > station.expected;
}

Extent confirmed_extent(const RecycledVector<Station>& stations, const Extent& before) {
  if (stations.size() < 2) return {};
  const double half = 0.5 * (stations[1].t - stations[0].t);
  const auto last_index = static_cast<int>(stations.size()) - 1;
  const auto at = [&](int i) -> const Station& { return stations[static_cast<std::size_t>(i)]; };
  const auto index_of = [&](double t) {
    return std::clamp(static_cast<int>(std::floor((t - stations[0].t) / (2.0 * half) + 0.5)), 0, last_index);
  };
  int first = index_of(before.t_begin + half);
  int last = index_of(before.t_end - half);
  if (first > last) return {};
  // A few pixels agree by chance anywhere: a stretch counts when about as many are to be seen as in the middle.
  RecycledVector<int> expected;
  for (int i = first; i <= last; ++i) expected.push_back(at(i).expected);
  const auto middle = expected.begin() + static_cast<std::ptrdiff_t>(expected.size() / 2);
  std::nth_element(expected.begin(), middle, expected.end());
  const auto sure = [&](int i) {
    return i >= 0 && i <= last_index && at(i).seen() && 3 * at(i).expected > *middle &&
           4 * at(i).agree > 3 * at(i).expected;
  };
  while (sure(first - 1)) --first;
  while (sure(last + 1)) ++last;
  while (first <= last && !at(first).seen() && !covered(at(first))) ++first;
  while (last >= first && !at(last).seen() && !covered(at(last))) --last;
  if (first > last) return {};
  return {at(first).t - half, at(last).t + half};
}

void fit_spline_to_extent(FollowedTube& tube) {
  auto& q = tube.model.spline.control_m;
  const Eigen::Vector3d middle = middle_of(tube.model);
  const RecycledColumn parameters = parameters_of(tube.model);
  int front = 0;
  int back = 0;
  while (q.size() > 6 && tube.model.spline.spans() - tube.extent.t_end > 2.5) {
    q.pop_back();
    --back;
  }
  while (q.size() > 6 && tube.extent.t_begin > 2.5) {
    q.erase(q.begin());
    ++tube.model.spline.first_span;
    --front;
    tube.extent.t_begin -= 1.0;
    tube.extent.t_end -= 1.0;
  }
  if (tube.model.spline.spans() - tube.extent.t_end < 1.0) {
    extend(tube.model.spline, false, true);
    ++back;
  }
  if (tube.extent.t_begin < 1.0) {
    extend(tube.model.spline, true, false);
    ++front;
    tube.extent.t_begin += 1.0;
    tube.extent.t_end += 1.0;
  }
  if (front == 0 && back == 0) return;
  const double far2 = tube.model.radius_m * tube.model.radius_m;
  tube.pooled = resized(tube.pooled, parameters, front, back);
  tube.quality.observed = resized(tube.quality.observed, parameters, front, back);
  tube.quality.covariance = resized(tube.quality.covariance, front, back, far2);
  tube.anchor = tube.model;
  if (!tube.at_rest) tube.frames_pooled = 0;  // counted since the anchor
  respan(tube.drift, front, back);
  tube.velocity.shift_m_s -= (middle_of(tube.model) - middle).cross(tube.velocity.turn_rad_s);
}

}  // namespace tubetrack
