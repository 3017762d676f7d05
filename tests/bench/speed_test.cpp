// What the speed benchmark computes beside the times.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>

#include "figures.hpp"
#include "floor_pass.hpp"
#include "race.hpp"
#include "speed_page.hpp"
#include "speed_scenes.hpp"
#include "statistics.hpp"

namespace tubetrack::bench {
namespace {

constexpr double kNone = std::numeric_limits<double>::quiet_NaN();

std::vector<std::uint16_t> random_pixels(std::size_t count) {
  std::mt19937 random(3);
  std::vector<std::uint16_t> pixels(count);
  for (std::uint16_t& pixel : pixels) pixel = random() % 5 == 0 ? 0 : static_cast<std::uint16_t>(random());
  return pixels;
}

/// All pixels of the box that are in the image, one by one.
double slow_mean_m(const DepthFrame& frame, int u, int v) {
  constexpr int kHalf = kFloorBox_px / 2;
  std::int64_t sum = 0;
  std::int64_t count = 0;
  for (int row = std::max(v - kHalf, 0); row <= std::min(v + kHalf, frame.height - 1); ++row) {
    for (int col = std::max(u - kHalf, 0); col <= std::min(u + kHalf, frame.width - 1); ++col) {
      sum += frame.row(row)[col];
      ++count;
    }
  }
  return static_cast<double>(sum) * frame.metres_per_unit / static_cast<double>(count);
}

TEST(FloorPass, GivesMetresAndTheMeanOfEveryBoxToFloatPrecisionWithAnyNumberOfThreads) {
  Workers one(1), three(3);
  FloorPass pass;  // one for all: sizes change
  for (const auto& [width, height] : {std::pair{40, 23}, {7, 7}, {16, 3}, {3, 16}, {1, 1}, {2, 9}}) {
    const std::size_t stride = static_cast<std::size_t>(width) + 5;
    const auto pixels = random_pixels(stride * static_cast<std::size_t>(height));
    const DepthFrame frame{pixels.data(), width, height, stride * 2, 0.001};
    floor_pass(frame, pass, three);
    const std::vector<float> by_three = pass.mean_m;
    floor_pass(frame, pass, one);
    EXPECT_EQ(pass.mean_m, by_three);
    ASSERT_EQ(pass.mean_m.size(), static_cast<std::size_t>(width * height));
    for (int v = 0; v < height; ++v) {
      for (int u = 0; u < width; ++u) {
        const auto at = static_cast<std::size_t>(v * width + u);
        EXPECT_FLOAT_EQ(pass.metres[at], static_cast<float>(frame.row(v)[u] * 0.001));
        const double mean_m = slow_mean_m(frame, u, v);
        ASSERT_NEAR(pass.mean_m[at], mean_m, 3e-7 * mean_m) << width << "x" << height << " at " << u << ", " << v;
      }
    }
  }
}

TEST(Statistics, QuantilesLieBetweenTheValuesBesideThem) {
  EXPECT_EQ(quantile({4.0, 1.0, 3.0, 2.0}, 0.0), 1.0);
  EXPECT_EQ(quantile({4.0, 1.0, 3.0, 2.0}, 0.5), 2.5);
  EXPECT_EQ(quantile({4.0, 1.0, 3.0, 2.0}, 1.0), 4.0);
  EXPECT_TRUE(std::isnan(quantile({}, 0.5)));
}

TEST(Statistics, P99IsTheValueThatOneInAHundredExceedsAndNeedsAThousand) {
  std::vector<double> values(1000);
  for (std::size_t i = 0; i < values.size(); ++i) values[i] = static_cast<double>((i * 7) % 1000);
  const double value = p99(values);
  EXPECT_EQ(std::ranges::count_if(values, [&](double v) { return v > value; }), 10);
  values.pop_back();
  EXPECT_TRUE(std::isnan(p99(values)));
}

TEST(Statistics, TheExponentOfAPowerIsFound) {
  const std::vector<double> x = {1.0, 2.0, 5.0, 11.0, 300.0};
  for (const double exponent : {-1.0, 0.0, 0.5, 1.0, 2.0}) {
    std::vector<double> y;
    for (const double value : x) y.push_back(0.003 * std::pow(value, exponent));
    EXPECT_NEAR(power_exponent(x, y), exponent, 1e-12);
  }
}

TEST(Statistics, TheExponentLeavesOutWhatHasNoLogarithmAndOneXHasNone) {
  EXPECT_NEAR(power_exponent(std::vector{0.0, 1.0, 2.0, 4.0, 3.0}, std::vector{5.0, 1.0, 4.0, 16.0, -1.0}), 2.0, 1e-12);
  EXPECT_TRUE(std::isnan(power_exponent(std::vector{2.0, 2.0}, std::vector{1.0, 3.0})));
  EXPECT_TRUE(std::isnan(power_exponent({}, {})));
}

TEST(Playing, GoesForthAndBackWithoutShowingAnEndTwice) {
  std::vector<int> shown;
  for (int i = 0; i < 10; ++i) shown.push_back(there_and_back(i, 4));
  EXPECT_EQ(shown, (std::vector{0, 1, 2, 3, 2, 1, 0, 1, 2, 3}));
  EXPECT_EQ(there_and_back(5, 1), 0);
  EXPECT_EQ(there_and_back(5, 2), 1);
}

TEST(Playing, WhatSwingsNeverJumps) {
  constexpr int kCount = 60;
  for (int i = 0; i < 300; ++i) {
    const auto at = [](int k) { return swing(there_and_back(k, kCount), kCount); };
    EXPECT_LT(std::abs(at(i + 1) - at(i)), 0.027);                     // π / 2 / 59
    EXPECT_LT(std::abs(at(i + 2) - 2.0 * at(i + 1) + at(i)), 0.0015);  // π² / 2 / 59²: nor does its speed
  }
}

TEST(Scenes, OfTheSpeedBenchmarkCanBe) {
  for (const SpeedScene& speed :
       {still_scene(), moving_tube_scene(), moving_tube_scene(1280, 720), moving_camera_scene(), three_tubes_scene(),
        no_tube_scene(), many_tubes_scene(16), changing_scene(0.0), changing_scene(0.5)}) {
    for (const int k : {0, 1, 30, 59}) {
      const auto valid = validate(scene_at(speed, k, 60));
      EXPECT_TRUE(valid) << speed.name << ": " << (valid ? "" : valid.error().message);
    }
  }
}

TEST(Scenes, TheShareOfCellsThatTheBoardChangesIsTheOneAskedFor) {
  for (const double share : {0.0, 0.125, 0.5}) {
    const SpeedScene speed = changing_scene(share);
    const double changed = cells_that_change(speed, render_all(speed, 6)) / (640.0 * 480.0);
    EXPECT_NEAR(changed, share, 0.04) << share;
  }
}

TEST(Race, GivesEveryContenderItsFramesAndTimesOnlyTheRun) {
  std::vector<RenderedFrame> frames(3);
  for (RenderedFrame& frame : frames) frame.width = frame.height = 1, frame.depth = {1};
  std::vector<std::int64_t> seen;
  const auto wait = [](double ms) {
    for (const double start_ms = thread_ms(); thread_ms() - start_ms < ms;) continue;
  };
  const std::vector<Contender> contenders = {
      {"all", [&](const DepthFrame& frame) { seen.push_back(frame.index), wait(2.0); },
       [&](const DepthFrame&) { wait(20.0); }},
      {"third", [&](const DepthFrame&) { wait(4.0); }, {}, 3}};
  const auto times_ms = race(frames, contenders, 2, 7, 100.0);
  EXPECT_EQ(seen, (std::vector<std::int64_t>{0, 1, 2, 3, 4, 5, 6, 7, 8}));
  ASSERT_EQ(times_ms[0].size(), 7U);
  ASSERT_EQ(times_ms[1].size(), 2U);  // frames 3 and 6
  EXPECT_NEAR(median(times_ms[0]), 2.0, 0.5);
  EXPECT_NEAR(median(times_ms[1]), 4.0, 0.5);
  EXPECT_EQ(race(frames, contenders, 0, 100, 0.0)[0].size(), 1U);
}

SpeedRow row_taking(const char* name, double ms, double floor_ms, double fals_ms) {
  SpeedRow row;
  row.name = name;
  row.frame_ms.assign(1000, ms);
  row.floor_ms.assign(1000, floor_ms);
  row.fals_ms.assign(1000, fals_ms);
  row.stages.resize(1000);
  for (StageTimes& stage : row.stages) stage.fit_ms = 0.1;
  row.tube_pixels = 10000.0;
  return row;
}

SpeedReport report_with(double moving_ms) {
  SpeedReport report;
  report.scenes = {row_taking("still", 1.0, 0.6, 2.4), row_taking("moving tube", moving_ms, 0.6, 2.4),
                   row_taking("moving camera", 5.0, 0.6, 2.4)};
  report.peers = {{"PCL, a", "", {60.0}, 1.0}, {"PCL, b", "", {80.0}, 1.0}};
  report.first = {{"still", 1, 1.0, {10.0}, {}, {}}, {"moving tube", 1, 1.0, {14.0}, {}, {}}};
  for (const double more : {0.0, 1.0, 2.0}) {
    report.changes.push_back(row_taking("board", 1.0 + more, 0.6, 2.4));
    report.changes.back().changed_cells = 100.0 + 1000.0 * more;
    report.volumes.push_back(row_taking("volume", 2.0, 0.6, 2.4));
  }
  return report;
}

std::size_t count_of(const std::string& text, const std::string& what) {
  std::size_t count = 0;
  for (std::size_t at = text.find(what); at != std::string::npos; at = text.find(what, at + 1)) ++count;
  return count;
}

TEST(Goals, AreJudgedByTheFigures) {
  const std::string good = speed_goals(report_with(2.6), 299.0);
  EXPECT_EQ(count_of(good, "✓"), 12U) << good;
  EXPECT_EQ(count_of(good, "✗"), 0U) << good;
  // A moving tube of 6 ms misses its median, its p99, both ratios and PCL's.
  const std::string bad = speed_goals(report_with(6.0), 301.0);
  EXPECT_EQ(count_of(bad, "✗"), 6U) << bad;
  EXPECT_NE(bad.find("10.0 ✗"), std::string::npos) << bad;  // the quicker PCL
}

TEST(Goals, WithoutAFigureNoneIsMet) {
  const std::string text = speed_goals({}, 0.0);
  EXPECT_EQ(count_of(text, "not measured"), 13U) << text;
  EXPECT_EQ(count_of(text, "✓") + count_of(text, "✗"), 0U) << text;
}

TEST(Goals, TheExponentIsThatOfTheTimeAboveTheFirstRow) {
  EXPECT_NEAR(changes_exponent(report_with(2.6).changes), 1.0, 1e-12);
}

}  // namespace
}  // namespace tubetrack::bench
