// The OpenNI2 back-end against the real runtime, with the virtual device as its sensor (docs/live.md).
#include "tubetrack/sensors/openni2_source.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>
#include <string>
#include <thread>
#include <vector>

#include "sensors/virtual_device_test.hpp"

namespace tubetrack {
namespace {

using std::chrono::milliseconds;
using test::kLong;
using testing::HasSubstr;

class OpenNi2Source : public test::VirtualDeviceTest {};

TEST_F(OpenNi2Source, EveryFrameIsTheRecordingsBitForBitUnmirroredWithItsTimestamp) {
  for (const double unit : {0.001, 0.0001}) {
    plug_in(8, unit);
    std::ofstream(lockstep_).flush();
    const auto source = open();
    ASSERT_TRUE(source);
    EXPECT_EQ(source->info().metres_per_unit, unit);
    DepthFrame frame;
    for (std::size_t i = 0; i < images_.size(); ++i) {
      ASSERT_EQ(source->next(frame, kLong), FrameOutcome::ok) << source->last_problem();
      EXPECT_EQ(frame.index, static_cast<std::int64_t>(i));
      EXPECT_EQ(frame.timestamp_s, images_[i].timestamp_s);
      EXPECT_EQ(frame.metres_per_unit, unit);
      EXPECT_EQ(pixels_of(frame), images_[i].pixels) << "frame " << i;
      allow_next();
    }
    EXPECT_EQ(source->dropped(), 0);
  }
}

TEST_F(OpenNi2Source, IntrinsicsComeFromTheFieldOfViewToAThousandthOfAPixel) {
  plug_in(1, 0.001, {640, 480, 571.234, 568.751, 319.5, 239.5, {}});
  const auto source = open();
  ASSERT_TRUE(source);
  const Intrinsics& got = source->info().intrinsics;
  EXPECT_EQ(got.width, 640);
  EXPECT_EQ(got.height, 480);
  EXPECT_EQ(got.fx_px, in_.fx_px);
  EXPECT_EQ(got.fy_px, in_.fy_px);
  EXPECT_EQ(got.cx_px, 319.5);
  EXPECT_EQ(got.cy_px, 239.5);
}

TEST_F(OpenNi2Source, GivenIntrinsicsReplaceTheFieldOfView) {
  plug_in(1);
  OpenNi2Options options;
  options.intrinsics_px = {33.0, 34.0, 18.0, 15.0};
  const auto source = open(options);
  ASSERT_TRUE(source);
  EXPECT_EQ(source->info().intrinsics.fx_px, 33.0);
  EXPECT_EQ(source->info().intrinsics.fy_px, 34.0);
  EXPECT_EQ(source->info().intrinsics.cx_px, 18.0);
  EXPECT_EQ(source->info().intrinsics.cy_px, 15.0);
  EXPECT_EQ(source->info().intrinsics.width, 40);
}

TEST_F(OpenNi2Source, AnAskedUnitIsConvertedToWithRounding) {
  plug_in(1, 0.0001);
  OpenNi2Options options;
  options.metres_per_unit = 0.001;
  const auto source = open(options);
  ASSERT_TRUE(source);
  DepthFrame frame;
  ASSERT_EQ(source->next(frame, kLong), FrameOutcome::ok);
  EXPECT_EQ(frame.metres_per_unit, 0.001);
  const auto pixels = pixels_of(frame);
  for (std::size_t i = 0; i < pixels.size(); ++i) ASSERT_EQ(pixels[i], (images_[0].pixels[i] + 5) / 10);
}

TEST_F(OpenNi2Source, TumsFifthOfAMillimetreBecomes100UmAndWhatIsTooFarBecomesNoReturn) {
  plug_in(1, 0.0002);
  const auto source = open();
  ASSERT_TRUE(source);
  DepthFrame frame;
  ASSERT_EQ(source->next(frame, kLong), FrameOutcome::ok);
  EXPECT_EQ(frame.metres_per_unit, 0.0001);
  const auto pixels = pixels_of(frame);
  for (std::size_t i = 0; i < pixels.size(); ++i) {
    const int twice = 2 * images_[0].pixels[i];
    ASSERT_EQ(pixels[i], twice > 65535 ? 0 : twice);
  }
}

TEST_F(OpenNi2Source, ASilentDeviceIsATimeOutEachTimeAndNotAHang) {
  plug_in(1);
  const auto source = open();
  ASSERT_TRUE(source);
  DepthFrame frame;
  ASSERT_EQ(source->next(frame, kLong), FrameOutcome::ok);
  for (int i = 0; i < 3; ++i) EXPECT_EQ(source->next(frame, milliseconds(60)), FrameOutcome::timeout);
  EXPECT_EQ(source->next(frame, milliseconds(0)), FrameOutcome::timeout);
}

TEST_F(OpenNi2Source, AnUnpluggedDeviceIsLostForGoodAndCloses) {
  set("TUBETRACK_VIRTUAL_AT_END", "unplug");
  for (int round = 0; round < 5; ++round) {
    plug_in(2);
    std::ofstream(lockstep_).flush();
    const auto source = open();
    ASSERT_TRUE(source);
    DepthFrame frame;
    ASSERT_EQ(source->next(frame, kLong), FrameOutcome::ok);
    allow_next();
    // The unplugging may overtake the last frame, as with a real cable.
    FrameOutcome outcome = source->next(frame, kLong);
    if (outcome == FrameOutcome::ok) outcome = source->next(frame, kLong);
    EXPECT_EQ(outcome, FrameOutcome::device_lost);
    EXPECT_EQ(source->last_problem(), "the device was unplugged");
    EXPECT_EQ(source->next(frame, kLong), FrameOutcome::device_lost);
  }
}

TEST_F(OpenNi2Source, FramesTheDeviceCouldNotSendAreCountedAsDropped) {
  plug_in(4);
  std::ofstream(folder_ / "recording/depth/000002.png", std::ios::binary | std::ios::trunc) << "no image";
  const auto source = open();
  ASSERT_TRUE(source);
  DepthFrame frame;
  for (const std::int64_t index : {0, 1, 3}) {
    ASSERT_EQ(source->next(frame, kLong), FrameOutcome::ok);
    EXPECT_EQ(frame.index, index);
    EXPECT_EQ(pixels_of(frame), images_[static_cast<std::size_t>(index)].pixels);
    allow_next();
  }
  EXPECT_EQ(source->dropped(), 1);
}

TEST_F(OpenNi2Source, KeptFramesOutliveTheDevice) {
  plug_in(6);
  std::vector<DepthFrame> kept;
  {
    const auto source = open();
    ASSERT_TRUE(source);
    DepthFrame frame;
    for (std::size_t i = 0; i < images_.size(); ++i) {
      ASSERT_EQ(source->next(frame, kLong), FrameOutcome::ok);
      kept.push_back(frame);
      allow_next();
    }
  }
  for (std::size_t i = 0; i < kept.size(); ++i) EXPECT_EQ(pixels_of(kept[i]), images_[i].pixels);
}

TEST_F(OpenNi2Source, ARepeatedRecordingGoesOnInTimeAndIndex) {
  set("TUBETRACK_VIRTUAL_AT_END", "repeat");
  plug_in(3);
  const auto source = open();
  ASSERT_TRUE(source);
  DepthFrame frame;
  double last_s = 0.0;
  for (std::size_t i = 0; i < 8; ++i) {
    ASSERT_EQ(source->next(frame, kLong), FrameOutcome::ok) << source->last_problem();
    EXPECT_EQ(frame.index, static_cast<std::int64_t>(i));
    EXPECT_EQ(pixels_of(frame), images_[i % 3].pixels);
    EXPECT_GT(frame.timestamp_s, last_s);
    last_s = frame.timestamp_s;
    allow_next();
  }
}

TEST_F(OpenNi2Source, ClosesInTheMiddleOfTheStreamAndOpensAgain) {
  unsetenv("TUBETRACK_VIRTUAL_LOCKSTEP");
  set("TUBETRACK_VIRTUAL_AT_END", "repeat");
  set("TUBETRACK_VIRTUAL_SPEED", "50");
  plug_in(20);
  for (int round = 0; round < 10; ++round) {
    const auto source = open();
    ASSERT_TRUE(source);
    DepthFrame frame;
    for (int i = 0; i < round; ++i) ASSERT_EQ(source->next(frame, kLong), FrameOutcome::ok) << source->last_problem();
  }
}

TEST_F(OpenNi2Source, IsReadFromAThreadThatDidNotOpenIt) {
  plug_in(5);
  const auto source = open();
  ASSERT_TRUE(source);
  std::vector<std::vector<std::uint16_t>> seen;
  std::thread capture([&] {
    DepthFrame frame;
    while (seen.size() < images_.size() && source->next(frame, kLong) == FrameOutcome::ok) {
      seen.push_back(pixels_of(frame));
      allow_next();
    }
  });
  capture.join();
  ASSERT_EQ(seen.size(), images_.size());
  for (std::size_t i = 0; i < seen.size(); ++i) EXPECT_EQ(seen[i], images_[i].pixels);
}

TEST_F(OpenNi2Source, ListsTheDeviceUnderTheUriThatOpensIt) {
  plug_in(1);
  const auto devices = list_openni2_devices();
  ASSERT_TRUE(devices) << devices.error().message;
  ASSERT_EQ(devices->size(), 1u);
  EXPECT_EQ(devices->front().uri, "virtual:0");
  EXPECT_EQ(devices->front().vendor, "tubetrack");
  EXPECT_EQ(devices->front().name, "recording recording");
  EXPECT_TRUE(open_openni2("virtual:0", {}));
}

TEST_F(OpenNi2Source, ACameraThatAFieldOfViewCannotDescribeSaysSoInItsName) {
  plug_in(1, 0.001, {40, 30, 35.5, 36.5, 18.25, 14.5, {}});
  const auto devices = list_openni2_devices();
  ASSERT_TRUE(devices);
  ASSERT_EQ(devices->size(), 1u);
  EXPECT_EQ(devices->front().name, "recording recording, needs --intrinsics 35.5,36.5,18.25,14.5");
}

TEST_F(OpenNi2Source, NoDeviceSaysWhatToDo) {
  const auto devices = list_openni2_devices();
  ASSERT_TRUE(devices);
  EXPECT_TRUE(devices->empty());
  const auto source = open_openni2("", {});
  ASSERT_FALSE(source);
  EXPECT_EQ(source.error().kind, Error::Kind::failed);
  EXPECT_THAT(source.error().message, HasSubstr("no OpenNI2 device found; plugged in? `tubetrack devices` lists them"));
}

TEST_F(OpenNi2Source, AModeThatIsNotOfferedListsThoseThatAre) {
  plug_in(1);
  OpenNi2Options options;
  options.width = 320;
  options.height = 240;
  const auto source = open_openni2("", options);
  ASSERT_FALSE(source);
  EXPECT_EQ(source.error().message,
            "virtual:0: no depth mode like 320x240@0 unit 0 m (0: any); the device offers 40x30@30 1 mm, "
            "40x30@30 100 um, 20x15@30 1 mm, 20x15@30 100 um");
}

TEST_F(OpenNi2Source, AUriThatIsNotThereIsRefusedInOneLine) {
  plug_in(1);
  const auto source = open_openni2("2bc5/0401@1/5", {});
  ASSERT_FALSE(source);
  EXPECT_THAT(source.error().message, HasSubstr("2bc5/0401@1/5: can't open the OpenNI2 device: "));
  EXPECT_EQ(source.error().message.find('\n'), std::string::npos);
}

TEST_F(OpenNi2Source, ARecordingThatCannotBeOpenedIsListedAndSaysWhy) {
  set("TUBETRACK_VIRTUAL_DEVICE", folder_ / "nothing-here");
  const auto devices = list_openni2_devices();
  ASSERT_TRUE(devices);
  ASSERT_EQ(devices->size(), 1u);
  EXPECT_THAT(devices->front().name, HasSubstr("unusable: "));
  const auto source = open_openni2("", {});
  ASSERT_FALSE(source);
  EXPECT_THAT(source.error().message, HasSubstr("nothing-here"));
  EXPECT_EQ(source.error().message.find('\n'), std::string::npos);
}

TEST_F(OpenNi2Source, AWrongSettingOfTheVirtualDeviceNamesItsVariable) {
  plug_in(1);
  set("TUBETRACK_VIRTUAL_SPEED", "-2");
  const auto source = open_openni2("", {});
  ASSERT_FALSE(source);
  EXPECT_THAT(source.error().message, HasSubstr("TUBETRACK_VIRTUAL_SPEED: got '-2', takes a factor above 0"));
}

}  // namespace
}  // namespace tubetrack
