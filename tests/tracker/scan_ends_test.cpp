#include "scan_ends.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <random>
#include <vector>

namespace tubetrack {
namespace {

constexpr double kEnd = 10.3, kSpacing = 0.1, kReach = 2.0;

/// Rings of faces, each of area 1, from the end at kEnd inward; places are the faces' middles.
std::vector<PlacedArea> rings(bool front, double slant) {
  std::vector<PlacedArea> areas;
  const double inward = front ? 1.0 : -1.0;
  for (int ring = 0; ring < 20; ++ring) {
    for (int k = 0; k < 36; ++k) {
      const double end = kEnd + slant * std::cos(2.0 * M_PI * k / 36.0);
      areas.push_back({end + inward * kSpacing * (ring + 0.5), 1.0, k / 6});
    }
  }
  return areas;
}

TEST(ScanEnds, OfWholeRingsAreWhereTheFirstOneBegins) {
  for (const bool front : {true, false}) {
    const TubeEnd end = end_of(rings(front, 0.0), 360, front, kSpacing);
    EXPECT_NEAR(end.t, kEnd, 0.05 * kSpacing);
    EXPECT_NEAR(end.sigma, 0.0, 1e-9);
  }
}

TEST(ScanEnds, ThatAreCutAskewAreLessSure) {
  const TubeEnd end = end_of(rings(true, 0.3), 360, true, kSpacing);
  EXPECT_NEAR(end.t, kEnd, 0.3);
  EXPECT_GT(end.sigma, 0.05);
}

TEST(ScanEnds, OfPointsWithoutOrderLieWithinTheirSigma) {
  std::mt19937_64 random(7);
  std::uniform_real_distribution<double> along(0.0, kReach);
  constexpr int kDraws = 400;
  int inside = 0;
  double squares = 0.0, sigma = 0.0;
  for (int draw = 0; draw < kDraws; ++draw) {
    std::vector<PlacedArea> areas;
    std::size_t outer = 0;
    for (int i = 0; i < 800; ++i) {
      areas.push_back({kEnd + along(random), 1.0, i % kEndSectors});
      outer += areas.back().t < kEnd + 0.5 * kReach ? 1U : 0U;
    }
    const TubeEnd end = end_of(areas, outer, true, kSpacing);
    inside += std::abs(end.t - kEnd) <= 1.96 * end.sigma ? 1 : 0;
    squares += (end.t - kEnd) * (end.t - kEnd) / kDraws;
    sigma += end.sigma / kDraws;
  }
  std::printf("ends of points: RMS %.4f, sigma %.4f, %.1f %% inside\n", std::sqrt(squares), sigma,
              100.0 * inside / kDraws);
  EXPECT_GT(inside, 0.88 * kDraws);  // six parts tell a sigma to a third
  EXPECT_GT(sigma, std::sqrt(squares));
  EXPECT_LT(sigma, 1.5 * std::sqrt(squares));  // the end is told by all of them together, and better than by each
}

TEST(ScanEnds, OfAPartOfTheSectionAloneHaveNoSigma) {
  std::vector<PlacedArea> areas = rings(true, 0.0);
  std::erase_if(areas, [](const PlacedArea& area) { return area.sector > 1; });
  EXPECT_EQ(end_of(areas, areas.size() / 2, true, kSpacing).sigma, 0.0);
}

}  // namespace
}  // namespace tubetrack
