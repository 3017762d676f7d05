#include "line_ends.hpp"

#include <gtest/gtest.h>

#include <Eigen/Core>
#include <cmath>

namespace tubetrack {
namespace {

using Eigen::Vector3d;

/// Control points 20 mm apart on a circle of 200 mm.
Spline arc_of(int count) {
  Spline arc;
  for (int i = 0; i < count; ++i) {
    const double angle = 0.1 * i;
    arc.control_m.emplace_back(0.2 * std::cos(angle), 0.2 * std::sin(angle), 0.8);
  }
  return arc;
}

TEST(LineEnds, AnArcThatGoesOnFromItsInsideComesOutOfHooksAtItsEnds) {
  const Spline arc = arc_of(14);
  Spline hooked = arc;
  hooked.control_m[0] += Vector3d(0.0, 0.0, 0.010);
  hooked.control_m[1] += Vector3d(0.0, 0.0, 0.003);
  hooked.control_m[13] -= Vector3d(0.0, 0.0, 0.010);
  continue_from(hooked, 1.0, arc.spans() - 1.0);
  for (std::size_t i = 0; i < arc.control_m.size(); ++i) {
    const bool kept = i > 1 && i < 12;
    // The bend (2 mm) keeps its direction, that of a circle turns.
    EXPECT_LT((hooked.control_m[i] - arc.control_m[i]).norm(), kept ? 1e-15 : 0.0015) << i;
  }
  EXPECT_EQ(hooked.first_span, arc.first_span);
}

TEST(LineEnds, GoingOnFromWhatIsTooShortOrFromAllOfItChangesNothing) {
  const Spline before = arc_of(10);
  Spline all = before;
  continue_from(all, -1.0, before.spans() + 1.0);
  EXPECT_EQ(all.control_m, before.control_m);
  Spline little = before;
  continue_from(little, 5.0, 2.0);
  EXPECT_EQ(little.control_m, before.control_m);
}

}  // namespace
}  // namespace tubetrack
