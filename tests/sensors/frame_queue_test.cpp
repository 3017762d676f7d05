#include "tubetrack/sensors/frame_queue.hpp"

#include <gtest/gtest.h>

#include <atomic>
#include <memory>
#include <set>
#include <thread>
#include <vector>

namespace tubetrack {
namespace {

using std::chrono::milliseconds;

constexpr milliseconds kNoPatience{0};
constexpr milliseconds kLong{60000};  // longer than any machine needs: never the measure of a test

QueuedFrame frame(std::int64_t index, FrameOutcome outcome = FrameOutcome::ok) {
  QueuedFrame item;
  item.outcome = outcome;
  item.frame.index = index;
  item.frame.keep_alive = std::make_shared<int>(0);
  return item;
}

TEST(FrameQueue, KeepsTheOrder) {
  FrameQueue queue(3);
  for (int i = 0; i < 3; ++i) queue.push(frame(i));
  QueuedFrame item;
  for (int i = 0; i < 3; ++i) {
    ASSERT_TRUE(queue.pop(item, kNoPatience));
    EXPECT_EQ(item.frame.index, i);
  }
  EXPECT_FALSE(queue.pop(item, kNoPatience));
  EXPECT_EQ(queue.dropped(), 0);
}

TEST(FrameQueue, FullDropsTheOldestAndCountsIt) {
  FrameQueue queue(2);
  for (int i = 0; i < 7; ++i) queue.push(frame(i));
  EXPECT_EQ(queue.dropped(), 5);
  QueuedFrame item;
  ASSERT_TRUE(queue.pop(item, kNoPatience));
  EXPECT_EQ(item.frame.index, 5);
  ASSERT_TRUE(queue.pop(item, kNoPatience));
  EXPECT_EQ(item.frame.index, 6);
}

TEST(FrameQueue, ACapacityOfNoneHoldsOneFrame) {
  FrameQueue queue(0);
  queue.push(frame(1));
  queue.push(frame(2));
  QueuedFrame item;
  ASSERT_TRUE(queue.pop(item, kNoPatience));
  EXPECT_EQ(item.frame.index, 2);
}

TEST(FrameQueue, ADroppedFrameLetsItsPixelsGo) {
  FrameQueue queue(1);
  QueuedFrame first = frame(0);
  const std::weak_ptr<const void> pixels = first.frame.keep_alive;
  queue.push(std::move(first));
  EXPECT_FALSE(pixels.expired());
  queue.push(frame(1));
  EXPECT_TRUE(pixels.expired());
}

TEST(FrameQueue, EndAndLossAreNeverDropped) {
  for (const FrameOutcome last : {FrameOutcome::end_of_stream, FrameOutcome::device_lost}) {
    FrameQueue queue(1);
    queue.push(frame(0, last));
    for (int i = 1; i < 10; ++i) queue.push(frame(i));
    QueuedFrame item;
    ASSERT_TRUE(queue.pop(item, kNoPatience));
    EXPECT_EQ(item.outcome, last);
    ASSERT_TRUE(queue.pop(item, kNoPatience));
    EXPECT_EQ(item.frame.index, 9);
    EXPECT_EQ(queue.dropped(), 8);
  }
}

TEST(FrameQueue, ACorruptFrameTakesAPlaceLikeAnyOther) {
  FrameQueue queue(1);
  queue.push(frame(0, FrameOutcome::corrupt));
  queue.push(frame(1));
  QueuedFrame item;
  ASSERT_TRUE(queue.pop(item, kNoPatience));
  EXPECT_EQ(item.frame.index, 1);
  EXPECT_EQ(queue.dropped(), 1);
}

TEST(FrameQueue, TimeOutsAreNotQueued) {
  FrameQueue queue(1);
  queue.push(frame(0));
  queue.push(frame(1, FrameOutcome::timeout));
  QueuedFrame item;
  ASSERT_TRUE(queue.pop(item, kNoPatience));
  EXPECT_EQ(item.outcome, FrameOutcome::ok);
  EXPECT_FALSE(queue.pop(item, kNoPatience));
  EXPECT_EQ(queue.dropped(), 0);
}

TEST(FrameQueue, ClosedGivesWhatItHasAndTakesNoMore) {
  FrameQueue queue(2);
  queue.push(frame(0));
  queue.close();
  queue.push(frame(1));
  QueuedFrame item;
  ASSERT_TRUE(queue.pop(item, kLong));
  EXPECT_EQ(item.frame.index, 0);
  EXPECT_FALSE(queue.pop(item, kLong));
}

TEST(FrameQueue, CloseWakesWhoeverWaits) {
  FrameQueue queue(1);
  bool got = true;
  std::thread waiting([&] {
    QueuedFrame item;
    got = queue.pop(item, kLong);
  });
  queue.close();
  waiting.join();
  EXPECT_FALSE(got);
}

TEST(FrameQueue, BetweenThreadsEachFrameComesOnceInOrderOrIsCounted) {
  constexpr std::int64_t kFrames = 20000;
  FrameQueue queue(4);
  std::vector<std::int64_t> seen;
  std::thread tracking([&] {
    QueuedFrame item;
    while (queue.pop(item, kLong) && item.outcome == FrameOutcome::ok) seen.push_back(item.frame.index);
  });
  for (std::int64_t i = 0; i < kFrames; ++i) queue.push(frame(i));
  queue.push(frame(kFrames, FrameOutcome::end_of_stream));
  tracking.join();
  for (std::size_t i = 1; i < seen.size(); ++i) ASSERT_LT(seen[i - 1], seen[i]);
  EXPECT_EQ(static_cast<std::int64_t>(seen.size()) + queue.dropped(), kFrames);
  EXPECT_EQ(seen.back(), kFrames - 1) << "the newest frame is never the one dropped";
}

TEST(FrameQueue, SeveralTakersShareTheFramesWithoutDoubles) {
  constexpr std::int64_t kFrames = 5000;
  FrameQueue queue(static_cast<std::size_t>(kFrames));
  std::vector<std::vector<std::int64_t>> seen(3);
  std::vector<std::thread> takers;
  for (auto& mine : seen) {
    takers.emplace_back([&queue, &mine] {
      QueuedFrame item;
      while (queue.pop(item, kLong)) mine.push_back(item.frame.index);
    });
  }
  for (std::int64_t i = 0; i < kFrames; ++i) queue.push(frame(i));
  queue.close();
  for (auto& taker : takers) taker.join();
  std::set<std::int64_t> all;
  for (const auto& mine : seen) all.insert(mine.begin(), mine.end());
  EXPECT_EQ(static_cast<std::int64_t>(all.size()), kFrames);
  EXPECT_EQ(seen[0].size() + seen[1].size() + seen[2].size(), all.size());
}

}  // namespace
}  // namespace tubetrack
