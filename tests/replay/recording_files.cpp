#include "recording_files.hpp"

#include <fmt/format.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <cstdlib>
#include <fstream>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>

namespace tubetrack::test {

TemporaryFolder::TemporaryFolder() {
  std::string name = (std::filesystem::temp_directory_path() / "tubetrack-XXXXXX").string();
  if (::mkdtemp(name.data()) == nullptr) throw std::runtime_error("no temporary folder");
  path_ = name;
}

TemporaryFolder::~TemporaryFolder() {
  std::error_code ignored;
  std::filesystem::remove_all(path_, ignored);
}

std::vector<std::uint16_t> slanted_depths(int width, int height, int seed, int nearest_units) {
  std::vector<std::uint16_t> depths;
  for (int v = 0; v < height; ++v) {
    for (int u = 0; u < width; ++u)
      depths.push_back(static_cast<std::uint16_t>(nearest_units + (u + 2 * v + seed) % 200));
  }
  return depths;
}

void write_text(const std::filesystem::path& path, std::string_view text) {
  std::filesystem::create_directories(path.parent_path());
  std::ofstream(path) << text;
}

void write_depth(const std::filesystem::path& path, int width, int height, int seed, int nearest_units) {
  std::filesystem::create_directories(path.parent_path());
  std::vector<std::uint16_t> depths = slanted_depths(width, height, seed, nearest_units);
  ASSERT_TRUE(cv::imwrite(path.string(), cv::Mat(height, width, CV_16UC1, depths.data())));
}

void write_8bit(const std::filesystem::path& path, int width, int height, int channels) {
  std::filesystem::create_directories(path.parent_path());
  ASSERT_TRUE(cv::imwrite(path.string(), cv::Mat(height, width, CV_8UC(channels), cv::Scalar::all(200))));
}

void truncate_to_half(const std::filesystem::path& path) {
  std::filesystem::resize_file(path, std::filesystem::file_size(path) / 2);
}

std::string camera_info_text(int width, int height, std::string_view fx, std::string_view depth_scale) {
  return fmt::format(
      "image_width: {}\nimage_height: {}\ncamera_matrix:\n  rows: 3\n  cols: 3\n"
      "  data: [{}, 0.0, 7.5, 0.0, 501.0, 5.5, 0.0, 0.0, 1.0]\n{}\n",
      width, height, fx, depth_scale);
}

void write_tum(const std::filesystem::path& folder, int count) {
  std::string list = "# timestamp filename\n";
  for (int i = 0; i < count; ++i) {
    const std::string name = fmt::format("depth/{:06d}.png", i);
    write_depth(folder / name, 16, 12, i);
    list += fmt::format("{:.1f} {}\n", 10.0 + 0.1 * i, name);
  }
  write_text(folder / "depth.txt", list);
  write_text(folder / "camera_info.yaml", camera_info_text(16, 12));
}

std::vector<SeenFrame> play(FrameSource& source) {
  std::vector<SeenFrame> seen;
  for (;;) {
    SeenFrame one{};
    one.outcome = source.next(one.frame, std::chrono::milliseconds(1000));
    if (one.outcome == FrameOutcome::end_of_stream) return seen;
    one.problem = source.last_problem();
    seen.push_back(std::move(one));
  }
}

Eigen::Isometry3d pose_or_nan(const std::optional<Eigen::Isometry3d>& pose) {
  if (pose) return *pose;
  Eigen::Isometry3d none;
  none.matrix().setConstant(std::nan(""));
  return none;
}

Error error_of(const std::filesystem::path& path, const RecordingOptions& options) {
  const auto opened = open_recording(path, options);
  if (opened) return {Error::Kind::failed, ""};
  EXPECT_EQ(opened.error().message.find('\n'), std::string::npos) << "an error is one line";
  return opened.error();
}

RecordingOptions flags() {
  RecordingOptions options;
  options.intrinsics_px = {500.0, 501.0, 7.5, 5.5};
  options.metres_per_unit = 0.001;
  return options;
}

std::filesystem::path real_data() {
  const char* elsewhere = std::getenv("TUBETRACK_TEST_DATA");
  const std::filesystem::path folder = elsewhere != nullptr
                                           ? std::filesystem::path(elsewhere)
                                           : std::filesystem::path(TUBETRACK_SOURCE_DIR) / ".." / "shared" / "data";
  return std::filesystem::is_directory(folder) ? folder : std::filesystem::path();
}

}  // namespace tubetrack::test
