// Real recordings against ../shared/data/references.csv: each body that is a tube is found, and nothing else is.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <map>
#include <numeric>
#include <opencv2/imgcodecs.hpp>
#include <vector>

#include "tubetrack/replay/recording.hpp"
#include "tubetrack/tracker/tube_tracker.hpp"

namespace tubetrack {
namespace {

namespace fs = std::filesystem;

fs::path data_folder() {
  const char* set = std::getenv("TUBETRACK_TEST_DATA");
  return set ? fs::path(set) : fs::path(TUBETRACK_SOURCE_DIR) / "../shared/data";
}

/// A single depth image with the intrinsics that ../shared/data/README.md gives for its folder.
TubeFrame track_image(const fs::path& image, const std::array<double, 4>& intrinsics_px) {
  RecordingOptions options;
  options.intrinsics_px = intrinsics_px;
  options.metres_per_unit = 0.001;
  auto recording = open_recording(image, options);
  if (!recording) {
    ADD_FAILURE() << recording.error().message;
    return {};
  }
  TrackerConfig config;
  auto tracker = TubeTracker::create(config, recording->source->info().intrinsics);
  DepthFrame frame;
  EXPECT_EQ(recording->source->next(frame, std::chrono::seconds(1)), FrameOutcome::ok);
  return tracker->track(frame);
}

const std::array<double, 4> kOsd{525.0, 525.0, 319.5, 239.5};
const std::array<double, 4> kD415{616.3653, 616.2029, 310.2588, 236.5998};

struct Reference {
  const char* image;
  const std::array<double, 4>* intrinsics_px;
  const char* label_image;  ///< empty: any tube counts
  int label;
  double low_mm, high_mm, length_mm;
};

/// The depth frames of references.csv.
const std::vector<Reference> kReferences{
    {"osd-xtion/depth/learn33.png", &kOsd, "osd-xtion/label/learn33.png", 50, 42.0, 45.0, 97},
    {"osd-xtion/depth/learn33.png", &kOsd, "osd-xtion/label/learn33.png", 61, 42.0, 45.0, 100},
    {"osd-xtion/depth/learn38.png", &kOsd, "osd-xtion/label/learn38.png", 20, 40.0, 41.8, 104},
    {"osd-xtion/depth/learn38.png", &kOsd, "osd-xtion/label/learn38.png", 30, 40.0, 42.7, 98},
    {"osd-xtion/depth/learn40.png", &kOsd, "osd-xtion/label/learn40.png", 30, 38.8, 40.8, 107},
    {"osd-xtion/depth/learn43.png", &kOsd, "osd-xtion/label/learn43.png", 20, 36.3, 39.3, 242},
    {"osd-xtion/depth/learn43.png", &kOsd, "osd-xtion/label/learn43.png", 40, 56.7, 58.1, 207},
    {"osd-xtion/depth/learn44.png", &kOsd, "osd-xtion/label/learn44.png", 30, 38.4, 39.9, 240},
    {"cans-mugs-d415/depth/cylinder.png", &kD415, "", 0, 34.1, 36.5, 152},
    {"cans-mugs-d415/depth/pepper.png", &kD415, "", 0, 22.4, 26.2, 93},
    {"can-rosbag/derived/depth.png", &kOsd, "", 0, 24.8, 26.5, 133},
};

/// Share of a tube's nodes that project into the object that the label belongs to (20–29 the first, 30–39 the second,
/// …: the axis of a mug leaves through its inside).
double share_in_label(const Tube& tube, const cv::Mat& labels, int label, const Intrinsics& in) {
  int inside = 0;
  for (const Eigen::Vector3d& node : tube.centerline_m) {
    const Eigen::Vector2d pixel = project(in, node);
    const int u = static_cast<int>(std::lround(pixel.x()));
    const int v = static_cast<int>(std::lround(pixel.y()));
    if (u < 0 || v < 0 || u >= labels.cols || v >= labels.rows) continue;
    inside += labels.at<std::uint8_t>(v, u) / 10 == label / 10 ? 1 : 0;
  }
  return static_cast<double>(inside) / static_cast<double>(tube.centerline_m.size());
}

class RealFrames : public ::testing::Test {
 protected:
  void SetUp() override {
    if (!fs::exists(data_folder())) GTEST_SKIP() << "no real recordings: set TUBETRACK_TEST_DATA to their folder";
  }
};

TEST_F(RealFrames, EveryReferenceIsFoundWithItsRadiusAndLength) {
  std::map<std::string, TubeFrame> results;
  std::vector<double> off;  // of the middle of the reference, as a part of it
  for (const Reference& reference : kReferences) {
    const fs::path image = data_folder() / reference.image;
    if (!results.contains(reference.image)) results[reference.image] = track_image(image, *reference.intrinsics_px);
    const TubeFrame& result = results[reference.image];
    const cv::Mat labels = *reference.label_image
                               ? cv::imread((data_folder() / reference.label_image).string(), cv::IMREAD_UNCHANGED)
                               : cv::Mat();
    const Intrinsics in{640,
                        480,
                        (*reference.intrinsics_px)[0],
                        (*reference.intrinsics_px)[1],
                        (*reference.intrinsics_px)[2],
                        (*reference.intrinsics_px)[3]};
    const Tube* best = nullptr;
    double best_share = 0.0;
    for (const Tube& tube : result.tubes) {
      const double share = labels.empty() ? 1.0 : share_in_label(tube, labels, reference.label, in);
      if (share > best_share) {
        best = &tube;
        best_share = share;
      }
    }
    const std::string what = fmt::format("{} label {}", reference.image, reference.label);
    if (!best) {
      ADD_FAILURE() << what << ": not found";
      continue;
    }
    const double radius_mm = best->radius_m * 1000.0;
    fmt::print("{:40} radius {:5.1f} in [{:.1f}, {:.1f}]  length {:5.0f} of {:3.0f}  inside {:3.0f} %\n", what,
               radius_mm, reference.low_mm, reference.high_mm, best->length_m * 1000.0, reference.length_mm,
               100.0 * best_share);
    const double middle_mm = 0.5 * (reference.low_mm + reference.high_mm);
    off.push_back(radius_mm / middle_mm - 1.0);
    EXPECT_NEAR(radius_mm, middle_mm, 1.96e3 * best->radius_sigma_m)
        << what << ": the middle of the reference is outside the 95 % interval";
    EXPECT_LE(2.0 * 1.96 * best->radius_sigma_m, 0.1 * best->radius_m) << what << ": too unsure";
    EXPECT_GE(radius_mm, 0.94 * reference.low_mm) << what;
    EXPECT_LE(radius_mm, 1.06 * reference.high_mm) << what;
    EXPECT_NEAR(best->length_m * 1000.0, reference.length_mm, 0.2 * reference.length_mm) << what;
    EXPECT_GE(best_share, 0.95) << what;
  }
  // What NoiseModel::radius_relative is by default stands on this (docs/noise.md).
  const double rms =
      std::sqrt(std::inner_product(off.begin(), off.end(), off.begin(), 0.0) / static_cast<double>(off.size()));
  const double worst = std::abs(*std::ranges::max_element(off, {}, [](double part) { return std::abs(part); }));
  fmt::print("radii off the middle of their references: {:.1f} % RMS, at most {:.1f} %\n", 100.0 * rms, 100.0 * worst);
}

/// Says and counts the tubes of frames that hold none.
int count_false_tubes(const std::vector<std::string>& images, const std::array<double, 4>& intrinsics_px) {
  int count = 0;
  for (const std::string& image : images) {
    for (const Tube& tube : track_image(data_folder() / image, intrinsics_px).tubes) {
      ++count;
      fmt::print("{}: tube of radius {:.1f} mm, length {:.0f} mm, confidence {:.2f} at {:.3f} {:.3f} {:.3f}\n", image,
                 tube.radius_m * 1e3, tube.length_m * 1e3, tube.confidence, tube.centerline_m[0].x(),
                 tube.centerline_m[0].y(), tube.centerline_m[0].z());
    }
  }
  return count;
}

TEST_F(RealFrames, NoTubeIsReportedOnBoxesBowlsAndTins) {
  std::vector<std::string> boxes;
  for (const int i : {0, 3, 6, 20, 26, 35, 36, 37}) boxes.push_back(fmt::format("osd-xtion/depth/learn{}.png", i));
  EXPECT_EQ(count_false_tubes(boxes, kOsd), 0);
  std::vector<std::string> objects;
  for (const char* name : {"cheezit", "sugar", "white_bowl", "green_bowl"}) {
    objects.push_back(fmt::format("cans-mugs-d415/depth/{}.png", name));
  }
  EXPECT_EQ(count_false_tubes(objects, kD415), 0);
}

TEST_F(RealFrames, NoTubeIsReportedInTwelveFramesOfALivingRoom) {
  const std::array<double, 4> kinect{640.0 / 2.0 / std::tan(1.01447 / 2.0), 480.0 / 2.0 / std::tan(0.78981 / 2.0),
                                     319.5, 239.5};
  std::vector<std::string> frames;
  for (int i = 0; i < 12; ++i) frames.push_back(fmt::format("kinect-oni/derived/depth_{:02}.png", i));
  EXPECT_EQ(count_false_tubes(frames, kinect), 0);
}

TEST_F(RealFrames, TheHandHeldRecordingRunsThroughItsFiftyFramesInTheWorldFrame) {
  auto recording = open_recording(data_folder() / "glue-f200-seq50", {});
  ASSERT_TRUE(recording) << recording.error().message;
  auto tracker = TubeTracker::create({}, recording->source->info().intrinsics);
  ASSERT_TRUE(tracker);
  int frames = 0;
  DepthFrame frame;
  while (recording->source->next(frame, std::chrono::seconds(1)) == FrameOutcome::ok) {
    const TubeFrame& result = tracker->track(frame);
    EXPECT_EQ(result.frame_id, "world");
    EXPECT_TRUE(result.status == TrackStatus::ok || result.status == TrackStatus::empty) << result.problem;
    ++frames;
  }
  EXPECT_EQ(frames, 50);
}

}  // namespace
}  // namespace tubetrack
