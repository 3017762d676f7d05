#include "tubetrack/tracker/segments.hpp"

#include <gmock/gmock.h>
#include <rapidcheck.h>
#include <rapidcheck/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>

#include "bent_tubes.hpp"

namespace tubetrack {
namespace {

using Eigen::Vector3d;
using test::chain_of;
using test::line_of;
using test::OwnedLine;
using test::rotation_error;
using test::types_of;

using test::kTubeRadius_m;

void expect_chain(const FittedChain& fitted, const PartChain& truth, double tolerance) {
  ASSERT_EQ(fitted.chain.bends.size(), truth.bends.size());
  for (std::size_t i = 0; i < truth.bends.size(); ++i) {
    const ChainBend& found = fitted.chain.bends[i];
    const ChainBend& expected = truth.bends[i];
    EXPECT_NEAR(found.straight_m, expected.straight_m, tolerance * kTubeRadius_m) << i;
    EXPECT_NEAR(found.radius_m, expected.radius_m, tolerance * kTubeRadius_m) << i;
    EXPECT_NEAR(found.angle_rad, expected.angle_rad, tolerance) << i;
    EXPECT_LT(i == 0 ? 0.0 : rotation_error(found.rotation_rad, expected.rotation_rad), tolerance) << i;
  }
  EXPECT_NEAR(fitted.chain.closing_m, truth.closing_m, tolerance * kTubeRadius_m);
  EXPECT_LT((fitted.chain.start_m - truth.start_m).norm(), tolerance * kTubeRadius_m);
  EXPECT_LT((fitted.chain.direction - truth.direction).norm(), tolerance);
}

struct KnownTube {
  const char* name;
  std::vector<ChainBend> bends;
  double closing;
  const char* types;
};

class KnownTubes : public testing::TestWithParam<KnownTube> {};

TEST_P(KnownTubes, WithoutNoiseComeBackAsTheyWere) {
  const PartChain truth = chain_of(GetParam().bends, GetParam().closing);
  const CenterlineParts parts = cut_into_parts(line_of(truth, 0.0, 0.0, 1).view());
  ASSERT_TRUE(parts.fitted);
  EXPECT_EQ(types_of(parts), GetParam().types);
  expect_chain(*parts.fitted, truth, 1e-4);
  double at_m = 0.0;
  for (const Segment& segment : parts.segments) {
    EXPECT_EQ(segment.from_m, at_m);
    at_m = segment.to_m;
    if (segment.type == Segment::Type::arc) {
      EXPECT_NEAR(segment.bend_radius_m * segment.bend_angle_rad, segment.to_m - segment.from_m, 1e-12);
    }
  }
  EXPECT_NEAR(at_m, length_of(truth), 1e-4 * kTubeRadius_m);
}

TEST_P(KnownTubes, WithNoiseHaveTheSameParts) {
  const PartChain truth = chain_of(GetParam().bends, GetParam().closing);
  for (std::uint64_t seed = 0; seed < 10; ++seed) {
    const CenterlineParts parts = cut_into_parts(line_of(truth, 0.02, 2.5, seed).view());
    ASSERT_TRUE(parts.fitted) << seed;
    ASSERT_EQ(parts.fitted->chain.bends.size(), truth.bends.size()) << seed;
  }
}

INSTANTIATE_TEST_SUITE_P(
    Segments, KnownTubes,
    testing::Values(KnownTube{"straight", {}, 30.0, "S"}, KnownTube{"one_bend", {{8.0, 0.0, 90.0, 6.0}}, 10.0, "SAS"},
                    KnownTube{"s_bend", {{8.0, 0.0, 60.0, 5.0}, {4.0, 180.0, 60.0, 5.0}}, 8.0, "SASAS"},
                    KnownTube{"three_bends",
                              {{8.0, 0.0, 90.0, 5.0}, {6.0, 45.0, 60.0, 6.0}, {9.0, -120.0, 45.0, 8.0}},
                              8.0,
                              "SASASAS"},
                    KnownTube{"u_bend", {{12.0, 0.0, 180.0, 5.0}}, 12.0, "SAS"},
                    KnownTube{"plane_unchanged", {{8.0, 0.0, 50.0, 6.0}, {6.0, 0.0, 50.0, 6.0}}, 8.0, "SASAS"}),
    [](const auto& tube) { return tube.param.name; });

/// Nodes half a radius apart along a curve.
OwnedLine line_along(const std::function<Vector3d(double)>& curve, double to, double sigma_radii, std::uint64_t seed) {
  std::mt19937_64 random(seed);
  std::normal_distribution<double> normal(0.0, sigma_radii * kTubeRadius_m);
  OwnedLine line;
  line.radius_m = kTubeRadius_m;
  line.correlation_m = 2.5 * kTubeRadius_m;
  Vector3d last = curve(0.0) - Vector3d::UnitX();
  for (int i = 0; i <= 20000; ++i) {
    const Vector3d point = curve(to * i / 20000.0);
    if ((point - last).norm() < 0.5 * kTubeRadius_m) continue;
    last = point;
    line.nodes_m.emplace_back(point + Vector3d(normal(random), normal(random), normal(random)));
    line.covariance_m2.emplace_back(std::pow(sigma_radii * kTubeRadius_m, 2) * Eigen::Matrix3d::Identity());
  }
  return line;
}

/// Nothing in it is straight or an arc.
Vector3d helix(double t) {
  return kTubeRadius_m * Vector3d(6.0 * std::cos(t), 6.0 * std::sin(t), 3.0 * t);
}

TEST(Segments, AHelixIsFree) {
  for (const double turns : {1.0, 4.0}) {
    const CenterlineParts parts = cut_into_parts(line_along(helix, turns * 2.0 * M_PI, 0.005, 1).view());
    EXPECT_FALSE(parts.fitted);
    EXPECT_THAT(types_of(parts), testing::MatchesRegex("S?FS?"));
  }
}

TEST(Segments, WhatIsStraightBesideAHelixStaysStraight) {
  const auto curve = [](double t) -> Vector3d {
    const double end = 2.0 * M_PI;
    if (t <= end) return helix(t);
    return helix(end) + (t - end) * kTubeRadius_m * Vector3d(0.0, 6.0, 3.0);
  };
  const CenterlineParts parts = cut_into_parts(line_along(curve, 2.0 * M_PI + 2.5, 0.01, 2).view());
  EXPECT_FALSE(parts.fitted);
  ASSERT_THAT(types_of(parts), testing::EndsWith("FS"));
  const Segment& straight = parts.segments.back();
  EXPECT_NEAR(straight.to_m - straight.from_m, 2.5 * kTubeRadius_m * std::hypot(6.0, 3.0), 3.0 * kTubeRadius_m);
}

TEST(Segments, AHoseIsFree) {
  const auto curve = [](double t) {
    return Vector3d(t * kTubeRadius_m, 0.03 * (t - 20.0) * (t - 20.0) * kTubeRadius_m, 0.8);
  };
  const CenterlineParts parts = cut_into_parts(line_along(curve, 40.0, 0.005, 3).view());
  EXPECT_FALSE(parts.fitted);
  EXPECT_THAT(types_of(parts), testing::HasSubstr("F"));
}

// A line that errs by up to three times what it says of itself, smoothly: 0.3 mm on a tube of 25 mm.
TEST(Segments, WobbleMakesNoBends) {
  for (std::uint64_t seed = 0; seed < 50; ++seed) {
    for (const double correlation : {2.5, 5.0}) {
      OwnedLine straight = line_of(chain_of({}, 40.0), 0.024, correlation, seed);
      OwnedLine bent = line_of(chain_of({{10.0, 0.0, 90.0, 8.0}}, 12.0), 0.024, correlation, seed);
      for (OwnedLine* line : {&straight, &bent}) {
        line->correlation_m = 2.5 * kTubeRadius_m;
        for (Eigen::Matrix3d& covariance : line->covariance_m2) covariance /= 9.0;
      }
      EXPECT_EQ(types_of(cut_into_parts(straight.view())), "S") << seed;
      EXPECT_EQ(types_of(cut_into_parts(bent.view())), "SAS") << seed;
    }
  }
}

// The caps of a tube bend the ends of its fitted line.
TEST(Segments, HooksAtUnsureEndsAreNoBends) {
  const PartChain truth = chain_of({{10.0, 0.0, 90.0, 8.0}}, 12.0);
  for (std::uint64_t seed = 0; seed < 20; ++seed) {
    OwnedLine line = line_of(truth, 0.005, 2.5, seed);
    MeasuredCenterline view = line.view();
    const std::size_t count = line.nodes_m.size();
    for (std::size_t k = 0; k < 3; ++k) {  // half a radius apart, turning by 0.5 rad
      const double off_m = 0.25 * kTubeRadius_m * static_cast<double>(3 - k);
      line.nodes_m[k] += off_m * truth.towards;
      line.nodes_m[count - 1 - k] += off_m * truth.direction;
    }
    view.unsure_end_m = 1.5 * kTubeRadius_m;
    const CenterlineParts parts = cut_into_parts(view);
    EXPECT_EQ(types_of(parts), "SAS") << seed;
    ASSERT_TRUE(parts.fitted);
    EXPECT_NEAR(parts.fitted->chain.bends[0].angle_rad, truth.bends[0].angle_rad,
                4.0 * parts.fitted->sigma[0].angle_rad);
  }
}

TEST(Segments, ATubeThatEndsInABendIsCutThere) {
  PartChain truth = chain_of({{8.0, 0.0, 60.0, 6.0}}, 0.0);
  const CenterlineParts parts = cut_into_parts(line_of(truth, 0.005, 2.5, 4).view());
  ASSERT_TRUE(parts.fitted);
  ASSERT_EQ(parts.fitted->chain.bends.size(), 1U);
  EXPECT_LE(parts.fitted->chain.closing_m, 0.5 * kTubeRadius_m);
  EXPECT_NEAR(length_of(parts.fitted->chain), length_of(truth), 0.05 * kTubeRadius_m);
}

TEST(Segments, OfTooLittleThereAreNone) {
  const OwnedLine good = line_of(chain_of({{8.0, 0.0, 90.0, 6.0}}, 10.0), 0.01, 2.5, 5);
  const auto none = [](const OwnedLine& line) {
    const CenterlineParts parts = cut_into_parts(line.view());
    return parts.segments.empty() && !parts.fitted;
  };
  EXPECT_TRUE(none({}));
  for (const std::size_t count : {0U, 1U, 2U}) {
    OwnedLine line = good;
    line.nodes_m.resize(count);
    line.covariance_m2.resize(count);
    EXPECT_TRUE(none(line)) << count;
  }
  OwnedLine line = good;
  std::fill(line.nodes_m.begin() + 2, line.nodes_m.end(), line.nodes_m[1]);
  EXPECT_TRUE(none(line));
  line = good;
  line.covariance_m2.pop_back();
  EXPECT_TRUE(none(line));
  for (const double bad : {std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity()}) {
    line = good;
    line.nodes_m[7].y() = bad;
    EXPECT_TRUE(none(line));
    line = good;
    line.covariance_m2[7](1, 1) = bad;
    EXPECT_TRUE(none(line));
    line = good;
    line.radius_m = bad;
    EXPECT_TRUE(none(line));
    line = good;
    line.correlation_m = bad;
    EXPECT_TRUE(none(line));
  }
  line = good;
  line.radius_m = 0.0;
  EXPECT_TRUE(none(line));
  line = good;
  line.covariance_m2[3](0, 0) = -1e-9;
  EXPECT_TRUE(none(line));
}

TEST(Segments, RepeatedNodesCountOnce) {
  const OwnedLine once = line_of(chain_of({{8.0, 0.0, 90.0, 6.0}}, 10.0), 0.01, 2.5, 6);
  OwnedLine twice = once;
  twice.nodes_m.insert(twice.nodes_m.begin() + 9, 3, twice.nodes_m[8]);
  twice.covariance_m2.insert(twice.covariance_m2.begin() + 9, 3, twice.covariance_m2[8]);
  const CenterlineParts a = cut_into_parts(once.view());
  const CenterlineParts b = cut_into_parts(twice.view());
  ASSERT_TRUE(a.fitted && b.fitted);
  EXPECT_EQ(a.fitted->chain.bends[0].angle_rad, b.fitted->chain.bends[0].angle_rad);
}

// Any numbers at all: nothing may hang, crash or come out that is not finite.
RC_GTEST_PROP(Segments, OfAnyFiniteLineAreFinite, (std::uint64_t seed)) {
  std::mt19937_64 random(seed);
  std::normal_distribution<double> normal;
  OwnedLine line;
  line.radius_m = kTubeRadius_m;
  line.correlation_m = seed % 2 == 0 ? 0.0 : 2.5 * kTubeRadius_m;
  const std::size_t count = 3 + random() % 60;
  const double spread_m = kTubeRadius_m * std::pow(10.0, normal(random));
  for (std::size_t i = 0; i < count; ++i) {
    line.nodes_m.emplace_back(spread_m * Vector3d(normal(random), normal(random), normal(random)));
    line.covariance_m2.emplace_back(std::pow(0.01 * kTubeRadius_m * normal(random), 2) * Eigen::Matrix3d::Identity());
  }
  const CenterlineParts parts = cut_into_parts(line.view());
  for (const Segment& segment : parts.segments) {
    RC_ASSERT(std::isfinite(segment.to_m) && segment.to_m > segment.from_m);
    if (segment.type == Segment::Type::arc) RC_ASSERT(segment.bend_radius_m > 0.0 && segment.bend_angle_rad > 0.0);
  }
  if (!parts.fitted) return;
  for (const BendSigma& sigma : parts.fitted->sigma) {
    RC_ASSERT(std::isfinite(sigma.straight_m + sigma.rotation_rad + sigma.angle_rad + sigma.radius_m));
  }
}

}  // namespace
}  // namespace tubetrack
