#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstdio>

#include "bent_tubes.hpp"

namespace tubetrack {
namespace {

using Eigen::Vector3d;
using test::chain_of;
using test::line_of;
using test::noisy_line;
using test::OwnedLine;
using test::random_chain;
using test::rotation_error;
using test::types_of;

using test::kTubeRadius_m;
constexpr double kDegree = M_PI / 180.0;

struct BendStatistics {
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

void add(BendStatistics& statistics, const PartChain& truth, const CenterlineParts& parts) {
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

BendStatistics random_tubes(int each, double sigma_radii, double correlation_radii) {
  BendStatistics statistics;
  std::mt19937_64 random(7);
  for (std::size_t bends = 1; bends <= 6; ++bends) {
    for (int i = 0; i < each; ++i) {
      const PartChain truth = random_chain(random, bends, kTubeRadius_m);
      const OwnedLine line =
          noisy_line(truth, kTubeRadius_m, sigma_radii * kTubeRadius_m, correlation_radii * kTubeRadius_m, random);
      add(statistics, truth, cut_into_parts(line.view()));
    }
  }
  return statistics;
}

void print(const BendStatistics& s) {
  std::printf(
      "right %d of %d; medians: angle %.3f deg, radius %.3f %%, rotation %.3f deg; inside 95 %%: %.3f %.3f %.3f %.3f\n",
      s.right, s.tubes, median(s.angle_deg), median(s.radius_percent), median(s.rotation_deg), s.part_inside(0),
      s.part_inside(1), s.part_inside(2), s.part_inside(3));
}

TEST(Segments, RandomTubesWithIndependentNoise) {
  const BendStatistics s = random_tubes(60, 0.02, 0.0);
  print(s);
  EXPECT_GE(s.right, 0.995 * s.tubes);
  EXPECT_LT(median(s.angle_deg), 0.085);
  EXPECT_LT(median(s.radius_percent), 0.12);
  EXPECT_LT(median(s.rotation_deg), 0.042);
  for (int kind = 0; kind < 4; ++kind) EXPECT_NEAR(s.part_inside(kind), 0.95, 0.015) << kind;
}

TEST(Segments, RandomTubesWithNoiseThatIsSmoothAlongTheLine) {
  const BendStatistics s = random_tubes(60, 0.02, 2.5);
  print(s);
  EXPECT_GE(s.right, 0.995 * s.tubes);
  EXPECT_LT(median(s.angle_deg), 0.17);
  EXPECT_LT(median(s.radius_percent), 0.23);
  EXPECT_LT(median(s.rotation_deg), 0.08);
  for (int kind = 0; kind < 4; ++kind) EXPECT_NEAR(s.part_inside(kind), 0.95, 0.015) << kind;
}

TEST(Segments, TwoArcsMayTouch) {
  for (const double rotation : {0.0, 90.0, 180.0}) {
    BendStatistics s;
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

/// Straights of at least 4 diameters at the ends: a short one before a wide bend is at the limit of what can be told.
PartChain clear_chain(std::mt19937_64& random, std::size_t bends) {
  PartChain chain = random_chain(random, bends, kTubeRadius_m);
  chain.bends.front().straight_m += 6.0 * kTubeRadius_m;
  chain.closing_m += 6.0 * kTubeRadius_m;
  return chain;
}

/// Whether two chains agree to a tenth of their uncertainty.
bool same(const FittedChain& a, const PartChain& b) {
  if (a.chain.bends.size() != b.bends.size() || (a.chain.start_m - b.start_m).norm() > 0.01 * kTubeRadius_m)
    return false;
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
    OwnedLine line =
        noisy_line(clear_chain(random, 1 + seed % 4), kTubeRadius_m, 0.01 * kTubeRadius_m, 2.5 * kTubeRadius_m, random);
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
    OwnedLine line =
        noisy_line(clear_chain(random, 1 + seed % 4), kTubeRadius_m, 0.01 * kTubeRadius_m, 2.5 * kTubeRadius_m, random);
    const CenterlineParts there = cut_into_parts(line.view());
    std::reverse(line.nodes_m.begin(), line.nodes_m.end());
    const CenterlineParts back = cut_into_parts(line.view());
    ASSERT_TRUE(there.fitted && back.fitted) << seed;
    EXPECT_TRUE(same(*back.fitted, test::reversed(there.fitted->chain))) << seed;
  }
}

}  // namespace
}  // namespace tubetrack
