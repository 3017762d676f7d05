#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "tubetrack/replay/recording.hpp"

namespace tubetrack::test {

/// A folder of its own for one test, gone with it.
class TemporaryFolder {
 public:
  TemporaryFolder();
  ~TemporaryFolder();
  TemporaryFolder(const TemporaryFolder&) = delete;
  TemporaryFolder& operator=(const TemporaryFolder&) = delete;

  const std::filesystem::path& path() const { return path_; }
  std::filesystem::path operator/(std::string_view name) const { return path_ / name; }

 private:
  std::filesystem::path path_;
};

/// Depths of a slanted plane, row-major, nearest_units and up to 200 more; they differ from seed to seed.
std::vector<std::uint16_t> slanted_depths(int width, int height, int seed, int nearest_units = 900);

void write_text(const std::filesystem::path& path, std::string_view text);
/// A 16-bit image in the format the extension names.
void write_depth(const std::filesystem::path& path, int width, int height, int seed, int nearest_units = 900);
/// An image of 0…255 with 1, 3 or 4 channels.
void write_8bit(const std::filesystem::path& path, int width, int height, int channels);
/// Cuts a file to the first half of its bytes.
void truncate_to_half(const std::filesystem::path& path);

/// A camera_info.yaml for a size, with fx as text so that a test can put anything there.
std::string camera_info_text(int width, int height, std::string_view fx = "500.0",
                             std::string_view depth_scale = "depth_scale: 0.001");

/// A TUM folder of `count` images, 16 × 12, 1 mm units, stamps 10.0, 10.1, …
void write_tum(const std::filesystem::path& folder, int count);

/// What a run over a recording saw.
struct SeenFrame {
  FrameOutcome outcome;
  DepthFrame frame;
  std::string problem;
};
std::vector<SeenFrame> play(FrameSource& source);

/// A pose that is there; one full of NaN, equal to nothing, where there is none.
Eigen::Isometry3d pose_or_nan(const std::optional<Eigen::Isometry3d>& pose);

/// The error of opening; its message is "" when there is none.
Error error_of(const std::filesystem::path& path, const RecordingOptions& options = {});

/// Flags that fit any small test image: fx, fy, cx, cy and millimetres.
RecordingOptions flags();

/// The folder of real recordings; empty when it is not there.
std::filesystem::path real_data();

}  // namespace tubetrack::test
