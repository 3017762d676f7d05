#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cstddef>
#include <span>

#include "tubetrack/tracker/fit.hpp"
#include "tubetrack/tracker/recycled.hpp"

namespace tubetrack {

inline constexpr int kStretchesPerSpan = 8;

/// What the observations of one short stretch say of the centreline's point there and the radius: sums over their terms
/// (`residual_of`), each weighted by 1/σ².
struct StretchSums {
  Eigen::Matrix3d point_point = Eigen::Matrix3d::Zero();
  Eigen::Vector3d point_radius = Eigen::Vector3d::Zero();
  Eigen::Vector3d point_residual = Eigen::Vector3d::Zero();
  double radius_radius = 0.0;
  double radius_residual = 0.0;
  double chi2 = 0.0;
  int used = 0;  ///< whose ray meets the tube well
};

/// An observation as `sum_stretches` takes it. Places are from the start of their span
/// (`SortedObservations::origin_m`), so that floats resolve some billionths of a metre. It is put where it belongs in
/// one go: the numbers of one side by side, not those of many.
struct ObservedPoint {
  float x, y, z;  ///< measured point
  float weight;   ///< 1/σ², with σ in lengths of the direction
};
struct ObservedRay {
  float x, y, z;  ///< along which it errs, of any length
  float s;        ///< place on the centreline, in spans from the start of its span
};

/// Stretch by stretch, each with so many that vectors take them whole: those that only fill up have no weight.
inline constexpr std::size_t kPartials = 8;
struct SortedObservations {
  RecycledVector<ObservedPoint> points;
  RecycledVector<ObservedRay> rays;
  RecycledVector<std::size_t> first;         ///< of each stretch, and one more
  RecycledVector<Eigen::Vector3d> origin_m;  ///< of each span
  std::size_t count = 0;                     ///< observations
};
/// By where they are expected on this centreline (`Observation::t`).
SortedObservations sort_by_stretch(std::span<const Observation> observations, const Spline& spline);

/// The same for whoever has the observations in another form: the stretch of a place; room for so many in each stretch
/// (buffers are used again), after which `count` holds where in `sorted` the first of each goes; and one put there.
inline std::size_t stretch_of(double t, std::size_t stretches) {
  return std::min(static_cast<std::size_t>(static_cast<int>(std::max(t, 0.0) * kStretchesPerSpan)), stretches - 1);
}
void make_room(const Spline& spline, RecycledVector<std::size_t>& count, SortedObservations& sorted);
inline void put(const Eigen::Vector3f& from_origin_m, const Eigen::Vector3f& direction, float weight, float s,
                std::size_t at, SortedObservations& sorted) {
  sorted.points[at] = {from_origin_m.x(), from_origin_m.y(), from_origin_m.z(), weight};
  sorted.rays[at] = {direction.x(), direction.y(), direction.z(), s};
}

/// One for each eighth of a span. An observation counts where it is expected (`Observation::t`): its own foot on the
/// centreline decides its residual, but not its stretch or span.
RecycledVector<StretchSums> sum_stretches(const TubeModel& model, const SortedObservations& observations);

}  // namespace tubetrack
