#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>

#include "tubetrack/tracker/fit.hpp"

namespace tubetrack {

inline double inverse_square(double sigma) {
  return 1.0 / (sigma * sigma);
}

/// What holds a centreline's shape whatever is seen of it, one statement after the other: that a combination of
/// neighbouring control points, `first` on, is zero, `weight` being the inverse of its covariance. `says` is called
/// with the first point, the factors of the combination and the weight, `holds` with a point that stays where it is,
/// and a weight. `seen_first` and `seen_last` are the first and the last control point that observations say anything
/// of.
template <typename Says, typename Holds>
void shape_priors(const TubeModel& model, double suppleness, std::size_t seen_first, std::size_t seen_last,
                  const Says& says, const Holds& holds) {
  /// σ of the centreline's third difference where nothing happens, of that where a straight meets a bend of radius 5 R.
  constexpr double kCalmThird = 0.05;
  const auto& q = model.spline.control_m;
  double spacing = 0.0;
  for (std::size_t k = 0; k + 1 < q.size(); ++k) spacing += (q[k + 1] - q[k]).norm();
  spacing /= static_cast<double>(q.size() - 1);
  // The third difference is zero on straights and arcs alike, so this smooths without pulling bends inward. Where a
  // straight meets the tightest usual bend (radius 5 R), it is spacing² / 5 R; elsewhere it is nearly none. So its
  // distribution has long tails (Cauchy's, by reweighting): few large ones cost less than many small ones. An end that
  // nothing observes goes on as it comes; with long tails a kink in it would stay.
  const double third_sigma = kCalmThird * suppleness * spacing * spacing / (5.0 * model.radius_m);
  for (std::size_t k = 0; k + 3 < q.size(); ++k) {
    const double third = (q[k + 3] - q[k] + 3.0 * (q[k + 1] - q[k + 2])).norm();
    const double far = k >= seen_first && k + 3 <= seen_last ? third / (3.0 * third_sigma) : 0.0;
    const double weight = inverse_square(third_sigma) / (1.0 + far * far);
    says(k, std::array<double, 4>{-1.0, 3.0, -3.0, 1.0}, Eigen::Matrix3d(weight * Eigen::Matrix3d::Identity()));
  }
  // A bend of radius 3 R is one σ: too weak to matter where the surface is seen, enough to hold what is not. Moving
  // points along the tube changes nothing that is seen, so that is held, and their spacing kept even.
  const double second_weight = inverse_square(suppleness * spacing * spacing / (3.0 * model.radius_m));
  const double even_weight = inverse_square(0.02 * spacing);
  for (std::size_t k = 0; k + 2 < q.size(); ++k) {
    const Eigen::Vector3d along = (q[k + 2] - q[k]).normalized();
    const Eigen::Matrix3d weight =
        second_weight * Eigen::Matrix3d::Identity() + even_weight * along * along.transpose();
    says(k, std::array<double, 3>{1.0, -2.0, 1.0}, weight);
  }
  for (std::size_t k = 0; k < q.size(); ++k) {
    const Eigen::Vector3d along = (q[std::min(k + 1, q.size() - 1)] - q[k > 0 ? k - 1 : 0]).normalized();
    Eigen::Matrix3d weight = inverse_square(0.03 * spacing) * along * along.transpose();
    // A faint hold on everything keeps ends that nothing observes from running away.
    weight.diagonal().array() += 1e-3 * inverse_square(model.radius_m);
    holds(k, weight);
  }
}

}  // namespace tubetrack
