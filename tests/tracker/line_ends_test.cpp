#include "line_ends.hpp"

#include <gtest/gtest.h>

#include <Eigen/Core>
#include <cmath>

#include "tubetrack/tracker/recycled.hpp"

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

/// Ten a span, seen where `sees` says so.
template <typename Sees>
RecycledVector<Station> stations_where_seen(double spans, Sees sees) {
  RecycledVector<Station> stations;
  for (double t = 0.05; t < spans; t += 0.1) {
    Station station;
    station.t = t;
    station.expected = 20;
    (sees(t) ? station.agree : station.before) = 20;
    stations.push_back(station);
  }
  return stations;
}

/// Of a straight, or one that leans away from the camera by `lean` along its way, seen where `sees` says so.
template <typename Sees>
EndTrim trim_where_seen(double lean, double spans, Sees sees) {
  Spline line;
  for (int i = 0; i < static_cast<int>(spans) + 3; ++i)
    line.control_m.emplace_back(0.02 * i - 0.2, 0.0, 0.8 + lean * i);
  return trim_of(line, stations_where_seen(spans, sees), {1.0, spans - 1.0});
}

TEST(LineEnds, AnEndThatTurnsItsFaceToTheCameraIsNotFitted) {
  const EndTrim trim = trim_where_seen(0.02, 20.0, [](double t) { return t < 8.0 || t > 9.0; });
  EXPECT_EQ(trim.at_begin, 0.6);
  EXPECT_EQ(trim.at_end, 0.0);
}

TEST(LineEnds, OfALineAcrossTheViewBothEndsAreFittedToTheLastReading) {
  const EndTrim trim = trim_where_seen(0.0, 20.0, [](double t) { return t < 12.0 || t > 18.0; });
  EXPECT_EQ(trim.at_begin, 0.0);
  EXPECT_EQ(trim.at_end, 0.0);
}

TEST(LineEnds, OfAnEndThatTurnsItsFaceToTheCameraAndIsSeenLittleHalfIsNotFitted) {
  const auto sees = [](double t) { return t < 1.8 || (t > 6.0 && t < 13.0) || t > 17.0; };
  const EndTrim trim = trim_where_seen(0.02, 19.0, sees);
  EXPECT_NEAR(trim.at_begin, 0.375, 1e-9);
  EXPECT_EQ(trim.at_end, 0.0);
}

TEST(LineEnds, AShortPieceGivesUpATenthAtAnEndThatTurnsItsFaceToTheCamera) {
  const EndTrim trim = trim_where_seen(0.02, 4.0, [](double) { return true; });
  EXPECT_NEAR(trim.at_begin, 0.2, 1e-12);
  EXPECT_EQ(trim.at_end, 0.0);
}

// What grows from a line is settled early where it is seen well: a tenth may be hidden, but no end that is seen little
// beyond a gap.
TEST(LineEnds, ALineIsSeenWellWithAGapInItButNotWithOneNearAnEnd) {
  const Extent extent{1.0, 19.0};
  const auto gap = [](double from, double to) { return [=](double t) { return t < from || t > to; }; };
  EXPECT_TRUE(is_well_seen(stations_where_seen(20.0, gap(9.0, 10.7)), extent));
  EXPECT_FALSE(is_well_seen(stations_where_seen(20.0, gap(9.0, 11.0)), extent));   // more than a tenth
  EXPECT_FALSE(is_well_seen(stations_where_seen(20.0, gap(14.0, 15.7)), extent));  // an end of 3.3 spans
  EXPECT_FALSE(is_well_seen(stations_where_seen(20.0, gap(4.9, 6.6)), extent));
}

}  // namespace
}  // namespace tubetrack
