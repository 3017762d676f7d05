// The libcamera back-end against the real libcamera.so, which captures from a camera in a fake kernel
// (fake_camera.hpp).
#include "tubetrack/sensors/libcamera_source.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <linux/videodev2.h>

#include <chrono>
#include <memory>
#include <thread>
#include <vector>

#include "mono_pixels.hpp"
#include "sensors/fake_camera.hpp"

namespace tubetrack {
namespace {

using std::chrono::milliseconds;
using std::chrono::steady_clock;
using test::FakeCameraSettings;
using testing::HasSubstr;

constexpr milliseconds kLong{20000};

LibcameraOptions usual_options() {
  LibcameraOptions options;
  options.width = 64;
  options.height = 48;
  options.metres_per_unit = 0.001;
  options.intrinsics_px = {60.0, 61.0, 31.5, 23.5};
  return options;
}

std::unique_ptr<FrameSource> open(const FakeCameraSettings& settings,
                                  const LibcameraOptions& options = usual_options()) {
  test::set_up_fake_camera(settings);
  auto source = open_libcamera("", options);
  EXPECT_TRUE(source) << (source ? "" : source.error().message);
  return source ? std::move(*source) : nullptr;
}

/// The camera's sequence numbers begin with 0, as do our indices when nothing was lost before the first frame.
void expect_pixels(const DepthFrame& frame, std::uint32_t sequence, int bits) {
  for (int v = 0; v < frame.height; ++v) {
    for (int u = 0; u < frame.width; ++u) {
      ASSERT_EQ(frame.row(v)[u], test::fake_pixel(sequence, u, v, bits))
          << "frame " << sequence << " at " << u << "," << v;
    }
  }
}

std::string refusal(const FakeCameraSettings& settings, const LibcameraOptions& options) {
  test::set_up_fake_camera(settings);
  const auto source = open_libcamera("", options);
  EXPECT_FALSE(source);
  return source ? "" : source.error().message;
}

TEST(LibcameraSource, EveryFormatThatCarriesDepthComesOutBitForBit) {
  struct Case {
    std::uint32_t format;
    int bits;
    int stride_bytes;
  };
  for (const Case& one : {Case{V4L2_PIX_FMT_GREY, 8, 0}, Case{V4L2_PIX_FMT_GREY, 8, 96}, Case{V4L2_PIX_FMT_Y10, 10, 0},
                          Case{V4L2_PIX_FMT_Y12, 12, 0}, Case{V4L2_PIX_FMT_Y12, 12, 160},
                          Case{V4L2_PIX_FMT_SBGGR16, 16, 0}, Case{V4L2_PIX_FMT_YUYV, 16, 0}}) {
    FakeCameraSettings settings;
    settings.formats = {one.format};
    settings.stride_bytes = one.stride_bytes;
    const auto source = open(settings);
    ASSERT_TRUE(source);
    EXPECT_EQ(source->info().metres_per_unit, 0.001);
    EXPECT_EQ(source->info().intrinsics.fx_px, 60.0);
    DepthFrame frame;
    double last_s = 0.0;
    for (int i = 0; i < 5; ++i) {
      ASSERT_EQ(source->next(frame, kLong), FrameOutcome::ok) << source->last_problem();
      expect_pixels(frame, static_cast<std::uint32_t>(frame.index), one.bits);
      EXPECT_GT(frame.timestamp_s, last_s);
      EXPECT_NE(frame.received, steady_clock::time_point{});
      last_s = frame.timestamp_s;
    }
  }
}

TEST(LibcameraSource, OfSeveralFormatsTheOneWithTheMostBitsIsTakenUnlessAsked) {
  FakeCameraSettings settings;
  settings.formats = {V4L2_PIX_FMT_GREY, V4L2_PIX_FMT_Y12, V4L2_PIX_FMT_Z16};
  auto source = open(settings);
  ASSERT_TRUE(source);
  DepthFrame frame;
  ASSERT_EQ(source->next(frame, kLong), FrameOutcome::ok);
  expect_pixels(frame, static_cast<std::uint32_t>(frame.index), 12);
  source.reset();
  LibcameraOptions options = usual_options();
  options.format = "R8";
  source = open(settings, options);
  ASSERT_TRUE(source);
  ASSERT_EQ(source->next(frame, kLong), FrameOutcome::ok);
  expect_pixels(frame, static_cast<std::uint32_t>(frame.index), 8);
}

TEST(LibcameraSource, ACameraOfY16AndZ16AloneIsRefusedWithTheVersionThatTakesIt) {
  FakeCameraSettings settings;
  settings.formats = {V4L2_PIX_FMT_Y16, V4L2_PIX_FMT_Z16};
  EXPECT_THAT(refusal(settings, usual_options()),
              testing::AllOf(HasSubstr("lists no camera"), HasSubstr("only Y16 or Z16 is not listed by this version"),
                             HasSubstr("libcamera 0.3.0 and later")));
}

TEST(LibcameraSource, WhatIsMissingOrWrongIsNamed) {
  FakeCameraSettings settings;
  settings.formats = {V4L2_PIX_FMT_Y12};
  LibcameraOptions options = usual_options();
  options.metres_per_unit = 0.0;
  EXPECT_THAT(refusal(settings, options), HasSubstr("give --depth-scale"));
  options = usual_options();
  options.intrinsics_px.reset();
  EXPECT_THAT(refusal(settings, options), HasSubstr("does not say the camera's geometry; give --intrinsics"));
  options.calibration = Intrinsics{80, 60, 60, 60, 40, 30, {}};
  EXPECT_THAT(refusal(settings, options), HasSubstr("the calibration is for 80x60 pixels and the device sends 64x48"));
  options = usual_options();
  options.format = "R10";
  EXPECT_THAT(refusal(settings, options), HasSubstr("sends R12, not R10"));
  options = usual_options();
  options.width = 1000;
  EXPECT_THAT(refusal(settings, options), HasSubstr("does not send R12 at 1000x48; its sizes are 32x24, 64x48"));
  settings.formats = {V4L2_PIX_FMT_MJPEG};
  EXPECT_THAT(refusal(settings, usual_options()), HasSubstr("sends MJPEG; depth can come as R8, R10, R12"));
  const auto other = open_libcamera("no-such-camera", usual_options());
  ASSERT_FALSE(other);
  EXPECT_THAT(other.error().message, HasSubstr("libcamera:no-such-camera: no such camera"));
}

TEST(LibcameraSource, TheListedUriOpensItAndASecondManagerIsRefused) {
  FakeCameraSettings settings;
  settings.formats = {V4L2_PIX_FMT_Y12};
  test::set_up_fake_camera(settings);
  const auto devices = list_libcamera_devices();
  ASSERT_TRUE(devices) << devices.error().message;
  ASSERT_EQ(devices->size(), 1U);
  ASSERT_TRUE(devices->front().uri.starts_with("libcamera:"));
  const auto source = open_libcamera(devices->front().uri.substr(10), usual_options());
  ASSERT_TRUE(source) << source.error().message;
  EXPECT_EQ((*source)->info().name, devices->front().uri);
  EXPECT_THAT(list_libcamera_devices().error().message, HasSubstr("has a camera open already"));
}

TEST(LibcameraSource, BrokenShortAndLostFramesAreToldApartAndEveryOneIsCounted) {
  FakeCameraSettings settings;
  settings.formats = {V4L2_PIX_FMT_Y12};
  settings.broken_every = 5;
  settings.short_every = 7;
  settings.drop_every = 11;
  const auto source = open(settings);
  ASSERT_TRUE(source);
  DepthFrame frame;
  std::int64_t good = 0;
  std::int64_t corrupt = 0;
  while (frame.index < 60) {
    const FrameOutcome outcome = source->next(frame, kLong);
    const bool bad = (frame.index + 1) % 5 == 0 || (frame.index + 1) % 7 == 0;
    ASSERT_EQ(outcome, bad ? FrameOutcome::corrupt : FrameOutcome::ok) << frame.index << source->last_problem();
    bad ? ++corrupt : ++good;
    if (!bad) expect_pixels(frame, static_cast<std::uint32_t>(frame.index), 12);
  }
  EXPECT_GE(source->dropped(), 5) << "each eleventh";
  EXPECT_EQ(good + corrupt + source->dropped(), frame.index + 1);
}

TEST(LibcameraSource, WhatArrivesAfterALaterFrameIsLeftOutAndCounted) {
  FakeCameraSettings settings;
  settings.formats = {V4L2_PIX_FMT_Y12};
  settings.late_every = 4;
  const auto source = open(settings);
  ASSERT_TRUE(source);
  DepthFrame frame;
  std::int64_t good = 0;
  std::int64_t last = -1;
  while (last < 40) {
    ASSERT_EQ(source->next(frame, kLong), FrameOutcome::ok) << source->last_problem();
    ASSERT_GT(frame.index, last);
    last = frame.index;
    ++good;
  }
  EXPECT_GE(source->dropped(), 9);
  EXPECT_EQ(good + source->dropped(), last + 1);
}

TEST(LibcameraSource, AnUnpluggedCameraIsLostWithinASecondAndComesBackThreeTimes) {
  FakeCameraSettings settings;
  settings.formats = {V4L2_PIX_FMT_Y12};
  test::set_up_fake_camera(settings);
  auto source =
      open_libcamera_reconnecting("", usual_options(), {milliseconds(20), milliseconds(200), milliseconds(5000)});
  ASSERT_TRUE(source) << source.error().message;
  DepthFrame frame;
  std::int64_t last = -1;
  const auto five_frames = [&] {
    const auto give_up = steady_clock::now() + kLong;
    for (int i = 0; i < 5 && steady_clock::now() < give_up;) {
      if ((*source)->next(frame, milliseconds(50)) != FrameOutcome::ok) continue;
      EXPECT_GT(frame.index, last);
      last = frame.index;
      ++i;
    }
    EXPECT_LT(steady_clock::now(), give_up);
  };
  for (int cycle = 0; cycle < 3; ++cycle) {
    five_frames();
    test::unplug_fake_camera();
    const auto pulled = steady_clock::now();
    while ((*source)->next(frame, milliseconds(50)) != FrameOutcome::device_lost) {
      ASSERT_LT(steady_clock::now() - pulled, milliseconds(1000));
    }
    EXPECT_EQ((*source)->last_problem(), "the camera was unplugged");
    for (int i = 0; i < 5; ++i) EXPECT_EQ((*source)->next(frame, milliseconds(20)), FrameOutcome::timeout);
    EXPECT_THAT((*source)->last_problem(), HasSubstr("lists no camera"));
    test::replug_fake_camera();
  }
  five_frames();
}

TEST(LibcameraSource, ClosingEndsAtAnyMoment) {
  FakeCameraSettings settings;
  settings.formats = {V4L2_PIX_FMT_Y12};
  for (int round = 0; round < 8; ++round) {
    auto source = open(settings);
    ASSERT_TRUE(source);
    DepthFrame frame;
    for (int i = 0; i < round; ++i) source->next(frame, milliseconds(100));
    if (round % 2 == 1) test::unplug_fake_camera();
    source.reset();
    if (round % 2 == 1) test::replug_fake_camera();
  }
}

TEST(MonoPixels, TenBitsPackedFourInFiveBytesAreUnpacked) {
  // 0x155, 0x2aa, 0x3ff, 0x001: the high eight bits of each, then the low two, the first pixel's lowest.
  const std::vector<std::byte> row = {std::byte{0x55}, std::byte{0xaa}, std::byte{0xff}, std::byte{0x00},
                                      std::byte{0x01 | 0x02 << 2 | 0x03 << 4 | 0x01 << 6}};
  std::uint16_t out[4] = {};
  unpack_mono(MonoPacking::csi2_ten_bits, row.data(), row.size(), 4, 1, out);
  EXPECT_THAT(out, testing::ElementsAre(0x155, 0x2aa, 0x3ff, 0x001));
  EXPECT_EQ(mono_row_bytes(MonoPacking::csi2_ten_bits, 640), 800U);
  EXPECT_EQ(mono_row_bytes(MonoPacking::csi2_ten_bits, 6), 0U);
}

}  // namespace
}  // namespace tubetrack
