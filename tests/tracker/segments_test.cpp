#include "tubetrack/tracker/segments.hpp"

#include <gmock/gmock.h>
#include <rapidcheck.h>
#include <rapidcheck/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <functional>
#include <limits>

#include "bent_tubes.hpp"

namespace tubetrack {
namespace {

using Eigen::Vector3d;
using test::noisy_line;
using test::OwnedLine;
using test::random_chain;

constexpr double kR = 0.0125;
constexpr double kDegree = M_PI / 180.0;

/// Lengths and radii in tube radii, angles in degrees.
PartChain chain_of(const std::vector<ChainBend>& bends, double closing) {
  PartChain chain;
  chain.start_m = {0.1, -0.2, 0.8};
  chain.direction = Vector3d(1.0, 2.0, 0.5).normalized();
  chain.towards = chain.direction.unitOrthogonal();
  for (const ChainBend& bend : bends) {
    chain.bends.push_back(
        {bend.straight_m * kR, bend.rotation_rad * kDegree, bend.angle_rad * kDegree, bend.radius_m * kR});
  }
  chain.closing_m = closing * kR;
  return chain;
}

OwnedLine line_of(const PartChain& chain, double sigma_radii, double correlation_radii, std::uint64_t seed) {
  std::mt19937_64 random(seed);
  return noisy_line(chain, kR, sigma_radii * kR, correlation_radii * kR, random);
}

std::string types_of(const CenterlineParts& parts) {
  std::string types;
  for (const Segment& segment : parts.segments) {
    types += segment.type == Segment::Type::straight ? 'S' : segment.type == Segment::Type::arc ? 'A' : 'F';
  }
  return types;
}

double rotation_error(double a_rad, double b_rad) {
  return std::abs(std::remainder(a_rad - b_rad, 2.0 * M_PI));
}

void expect_chain(const FittedChain& fitted, const PartChain& truth, double tolerance) {
  ASSERT_EQ(fitted.chain.bends.size(), truth.bends.size());
  for (std::size_t i = 0; i < truth.bends.size(); ++i) {
    const ChainBend& found = fitted.chain.bends[i];
    const ChainBend& expected = truth.bends[i];
    EXPECT_NEAR(found.straight_m, expected.straight_m, tolerance * kR) << i;
    EXPECT_NEAR(found.radius_m, expected.radius_m, tolerance * kR) << i;
    EXPECT_NEAR(found.angle_rad, expected.angle_rad, tolerance) << i;
    EXPECT_LT(i == 0 ? 0.0 : rotation_error(found.rotation_rad, expected.rotation_rad), tolerance) << i;
  }
  EXPECT_NEAR(fitted.chain.closing_m, truth.closing_m, tolerance * kR);
  EXPECT_LT((fitted.chain.start_m - truth.start_m).norm(), tolerance * kR);
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
  EXPECT_NEAR(at_m, length_of(truth), 1e-4 * kR);
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
  std::normal_distribution<double> normal(0.0, sigma_radii * kR);
  OwnedLine line;
  line.radius_m = kR;
  line.correlation_m = 2.5 * kR;
  Vector3d last = curve(0.0) - Vector3d::UnitX();
  for (int i = 0; i <= 20000; ++i) {
    const Vector3d point = curve(to * i / 20000.0);
    if ((point - last).norm() < 0.5 * kR) continue;
    last = point;
    line.nodes_m.emplace_back(point + Vector3d(normal(random), normal(random), normal(random)));
    line.covariance_m2.emplace_back(std::pow(sigma_radii * kR, 2) * Eigen::Matrix3d::Identity());
  }
  return line;
}

/// Nothing in it is straight or an arc.
Vector3d helix(double t) {
  return kR * Vector3d(6.0 * std::cos(t), 6.0 * std::sin(t), 3.0 * t);
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
    return helix(end) + (t - end) * kR * Vector3d(0.0, 6.0, 3.0);
  };
  const CenterlineParts parts = cut_into_parts(line_along(curve, 2.0 * M_PI + 2.5, 0.01, 2).view());
  EXPECT_FALSE(parts.fitted);
  ASSERT_THAT(types_of(parts), testing::EndsWith("FS"));
  const Segment& straight = parts.segments.back();
  EXPECT_NEAR(straight.to_m - straight.from_m, 2.5 * kR * std::hypot(6.0, 3.0), 3.0 * kR);
}

TEST(Segments, AHoseIsFree) {
  const auto curve = [](double t) { return Vector3d(t * kR, 0.03 * (t - 20.0) * (t - 20.0) * kR, 0.8); };
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
        line->correlation_m = 2.5 * kR;
        for (Eigen::Matrix3d& covariance : line->covariance_m2) covariance /= 9.0;
      }
      EXPECT_EQ(types_of(cut_into_parts(straight.view())), "S") << seed;
      EXPECT_EQ(types_of(cut_into_parts(bent.view())), "SAS") << seed;
    }
  }
}

struct Statistics {
  int tubes = 0;
  int right = 0;
  std::vector<double> angle_deg, radius_percent, rotation_deg;
  int intervals[4] = {};  ///< straight, angle, radius, rotation
  int inside[4] = {};

  void add(int kind, double error, double sigma) {
    ++intervals[kind];
    inside[kind] += std::abs(error) < 1.96 * sigma ? 1 : 0;
  }
  double part_inside(int kind) const { return inside[kind] / static_cast<double>(intervals[kind]); }
};

void add(Statistics& statistics, const PartChain& truth, const CenterlineParts& parts) {
  ++statistics.tubes;
  if (!parts.fitted || parts.fitted->chain.bends.size() != truth.bends.size()) return;
  ++statistics.right;
  for (std::size_t i = 0; i < truth.bends.size(); ++i) {
    const ChainBend& found = parts.fitted->chain.bends[i];
    const ChainBend& expected = truth.bends[i];
    const BendSigma& sigma = parts.fitted->sigma[i];
    const double angle_rad = std::abs(found.angle_rad - expected.angle_rad);
    statistics.angle_deg.push_back(angle_rad / kDegree);
    statistics.radius_percent.push_back(100.0 * std::abs(found.radius_m / expected.radius_m - 1.0));
    statistics.add(0, found.straight_m - expected.straight_m, sigma.straight_m);
    statistics.add(1, angle_rad, sigma.angle_rad);
    statistics.add(2, found.radius_m - expected.radius_m, sigma.radius_m);
    if (i == 0) continue;
    const double rotation_rad = rotation_error(found.rotation_rad, expected.rotation_rad);
    statistics.rotation_deg.push_back(rotation_rad / kDegree);
    statistics.add(3, rotation_rad, sigma.rotation_rad);
  }
}

double median(std::vector<double> values) {
  std::nth_element(values.begin(), values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2), values.end());
  return values[values.size() / 2];
}

Statistics random_tubes(int each, double sigma_radii, double correlation_radii) {
  Statistics statistics;
  std::mt19937_64 random(7);
  for (std::size_t bends = 1; bends <= 6; ++bends) {
    for (int i = 0; i < each; ++i) {
      const PartChain truth = random_chain(random, bends, kR);
      const OwnedLine line = noisy_line(truth, kR, sigma_radii * kR, correlation_radii * kR, random);
      add(statistics, truth, cut_into_parts(line.view()));
    }
  }
  return statistics;
}

void print(const Statistics& s) {
  std::printf(
      "right %d of %d; medians: angle %.3f deg, radius %.3f %%, rotation %.3f deg; inside 95 %%: %.3f %.3f %.3f %.3f\n",
      s.right, s.tubes, median(s.angle_deg), median(s.radius_percent), median(s.rotation_deg), s.part_inside(0),
      s.part_inside(1), s.part_inside(2), s.part_inside(3));
}

TEST(Segments, RandomTubesWithIndependentNoise) {
  const Statistics s = random_tubes(60, 0.02, 0.0);
  print(s);
  EXPECT_GE(s.right, 0.995 * s.tubes);
  EXPECT_LT(median(s.angle_deg), 0.085);
  EXPECT_LT(median(s.radius_percent), 0.12);
  EXPECT_LT(median(s.rotation_deg), 0.042);
  for (int kind = 0; kind < 4; ++kind) EXPECT_NEAR(s.part_inside(kind), 0.95, 0.015) << kind;
}

TEST(Segments, RandomTubesWithNoiseThatIsSmoothAlongTheLine) {
  const Statistics s = random_tubes(60, 0.02, 2.5);
  print(s);
  EXPECT_GE(s.right, 0.995 * s.tubes);
  EXPECT_LT(median(s.angle_deg), 0.17);
  EXPECT_LT(median(s.radius_percent), 0.23);
  EXPECT_LT(median(s.rotation_deg), 0.08);
  for (int kind = 0; kind < 4; ++kind) EXPECT_NEAR(s.part_inside(kind), 0.95, 0.015) << kind;
}

TEST(Segments, TwoArcsMayTouch) {
  for (const double rotation : {0.0, 90.0, 180.0}) {
    Statistics s;
    const PartChain truth = chain_of({{8.0, 0.0, 60.0, 5.0}, {0.0, rotation, 70.0, 12.0}}, 8.0);
    for (std::uint64_t seed = 0; seed < 100; ++seed) {
      const CenterlineParts parts = cut_into_parts(line_of(truth, 0.01, 2.5, seed).view());
      add(s, truth, parts);
      EXPECT_TRUE(types_of(parts) == "SAAS" || types_of(parts) == "SASAS") << types_of(parts);
    }
    EXPECT_EQ(s.right, s.tubes) << rotation;
    EXPECT_NEAR(s.part_inside(1), 0.95, 0.04) << rotation;
    EXPECT_NEAR(s.part_inside(2), 0.95, 0.04) << rotation;
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
      const double off_m = 0.25 * kR * static_cast<double>(3 - k);
      line.nodes_m[k] += off_m * truth.towards;
      line.nodes_m[count - 1 - k] += off_m * truth.direction;
    }
    view.unsure_end_m = 1.5 * kR;
    const CenterlineParts parts = cut_into_parts(view);
    EXPECT_EQ(types_of(parts), "SAS") << seed;
    ASSERT_TRUE(parts.fitted);
    EXPECT_NEAR(parts.fitted->chain.bends[0].angle_rad, truth.bends[0].angle_rad,
                4.0 * parts.fitted->sigma[0].angle_rad);
  }
}

/// Straights of at least 4 diameters at the ends: a short one before a wide bend is at the limit of what can be told.
PartChain clear_chain(std::mt19937_64& random, std::size_t bends) {
  PartChain chain = random_chain(random, bends, kR);
  chain.bends.front().straight_m += 6.0 * kR;
  chain.closing_m += 6.0 * kR;
  return chain;
}

/// Whether two chains agree to a tenth of their uncertainty.
bool same(const FittedChain& a, const PartChain& b) {
  if (a.chain.bends.size() != b.bends.size() || (a.chain.start_m - b.start_m).norm() > 0.01 * kR) return false;
  for (std::size_t i = 0; i < b.bends.size(); ++i) {
    const ChainBend& x = a.chain.bends[i];
    const ChainBend& y = b.bends[i];
    if (std::abs(x.angle_rad - y.angle_rad) > 0.1 * a.sigma[i].angle_rad) return false;
    if (std::abs(x.radius_m - y.radius_m) > 0.1 * a.sigma[i].radius_m) return false;
    if (i > 0 && std::abs(x.straight_m - y.straight_m) > 0.1 * a.sigma[i].straight_m) return false;
    if (i > 0 && rotation_error(x.rotation_rad, y.rotation_rad) > 0.1 * a.sigma[i].rotation_rad) return false;
  }
  return true;
}

PartChain moved(PartChain chain, const Eigen::Isometry3d& motion) {
  chain.start_m = motion * chain.start_m;
  chain.direction = motion.linear() * chain.direction;
  chain.towards = motion.linear() * chain.towards;
  return chain;
}

// Seeds are fixed: one tube in a thousand is at the limit of what can be told, and comes out one way or the other.
TEST(Segments, MoveWithTheirLine) {
  for (std::uint64_t seed = 0; seed < 100; ++seed) {
    std::mt19937_64 random(seed);
    OwnedLine line = noisy_line(clear_chain(random, 1 + seed % 4), kR, 0.01 * kR, 2.5 * kR, random);
    const CenterlineParts before = cut_into_parts(line.view());
    std::normal_distribution<double> normal;
    const Eigen::Quaterniond turn(normal(random), normal(random), normal(random), normal(random));
    Eigen::Isometry3d motion(turn.normalized());
    motion.pretranslate(Vector3d(normal(random), normal(random), normal(random)));
    for (Vector3d& node : line.nodes_m) node = motion * node;
    const CenterlineParts after = cut_into_parts(line.view());
    ASSERT_TRUE(before.fitted && after.fitted) << seed;
    EXPECT_TRUE(same(*after.fitted, moved(before.fitted->chain, motion))) << seed;
  }
}

TEST(Segments, FromTheOtherEndAreTheSame) {
  for (std::uint64_t seed = 0; seed < 100; ++seed) {
    std::mt19937_64 random(seed);
    OwnedLine line = noisy_line(clear_chain(random, 1 + seed % 4), kR, 0.01 * kR, 2.5 * kR, random);
    const CenterlineParts there = cut_into_parts(line.view());
    std::reverse(line.nodes_m.begin(), line.nodes_m.end());
    const CenterlineParts back = cut_into_parts(line.view());
    ASSERT_TRUE(there.fitted && back.fitted) << seed;
    EXPECT_TRUE(same(*back.fitted, reversed(there.fitted->chain))) << seed;
  }
}

TEST(Segments, ATubeThatEndsInABendIsCutThere) {
  PartChain truth = chain_of({{8.0, 0.0, 60.0, 6.0}}, 0.0);
  const CenterlineParts parts = cut_into_parts(line_of(truth, 0.005, 2.5, 4).view());
  ASSERT_TRUE(parts.fitted);
  ASSERT_EQ(parts.fitted->chain.bends.size(), 1U);
  EXPECT_LE(parts.fitted->chain.closing_m, 0.5 * kR);
  EXPECT_NEAR(length_of(parts.fitted->chain), length_of(truth), 0.05 * kR);
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
  line.radius_m = kR;
  line.correlation_m = seed % 2 == 0 ? 0.0 : 2.5 * kR;
  const std::size_t count = 3 + random() % 60;
  const double spread_m = kR * std::pow(10.0, normal(random));
  for (std::size_t i = 0; i < count; ++i) {
    line.nodes_m.emplace_back(spread_m * Vector3d(normal(random), normal(random), normal(random)));
    line.covariance_m2.emplace_back(std::pow(0.01 * kR * normal(random), 2) * Eigen::Matrix3d::Identity());
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
