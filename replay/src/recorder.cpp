#include "tubetrack/replay/recorder.hpp"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cerrno>
#include <cstring>

#include "image_file.hpp"
#include "tubetrack/replay/camera_info.hpp"

namespace tubetrack {

namespace {

/// First line of depth.txt; a folder that begins so is ours to overwrite.
constexpr std::string_view kMark = "# tubetrack recording: timestamp filename";

tl::unexpected<Error> cannot(const std::filesystem::path& path, std::string_view what, std::string_view why) {
  return tl::make_unexpected(Error::failed(
      fmt::format("{}: cannot be {}: {}; check the free space and the rights", path.string(), what, why)));
}

bool is_ours(const std::filesystem::path& folder) {
  std::ifstream list(folder / "depth.txt");
  std::string line;
  return std::getline(list, line) && line == kMark;
}

bool is_numbered_image(const std::filesystem::path& path) {
  const std::string name = path.filename().string();
  const std::size_t digits = std::min(name.find_first_not_of("0123456789"), name.size());
  return digits >= 6 && (name.substr(digits) == ".png" || name.substr(digits) == ".png.tmp");
}

/// Takes away what an earlier recording left, and nothing else.
void remove_recording(const std::filesystem::path& folder, std::error_code& error) {
  for (std::filesystem::directory_iterator entry(folder / "depth", error), end; !error && entry != end;
       entry.increment(error)) {
    if (is_numbered_image(entry->path())) std::filesystem::remove(entry->path(), error);
  }
  error.clear();
  for (const char* name : {"camera_info.yaml", "groundtruth.txt", "truth.jsonl", "depth.txt"}) {
    if (!error) std::filesystem::remove(folder / name, error);
  }
}

Expected<void> make_folder(const std::filesystem::path& folder) {
  std::error_code error;
  if (std::filesystem::exists(folder, error) && !std::filesystem::is_directory(folder, error)) {
    return tl::make_unexpected(Error::usage(fmt::format("{}: is a file; give a folder to record to", folder.string())));
  }
  if (std::filesystem::is_directory(folder, error) && !std::filesystem::is_empty(folder, error)) {
    if (!is_ours(folder)) {
      return tl::make_unexpected(Error::usage(fmt::format(
          "{}: is not empty and no recording of tubetrack; give a new or empty folder to record to", folder.string())));
    }
    remove_recording(folder, error);
    if (error) return cannot(folder, "emptied", error.message());
  }
  std::filesystem::create_directories(folder / "depth", error);
  if (error) return cannot(folder / "depth", "made", error.message());
  return {};
}

std::string pose_line(double timestamp_s, const Eigen::Isometry3d& world_from_camera) {
  const Eigen::Vector3d t = world_from_camera.translation();
  const Eigen::Quaterniond q(world_from_camera.linear());
  return fmt::format("{} {} {} {} {} {} {} {}\n", timestamp_s, t.x(), t.y(), t.z(), q.x(), q.y(), q.z(), q.w());
}

}  // namespace

Expected<Recorder> Recorder::create(const std::filesystem::path& folder, const StreamInfo& info) {
  if (auto valid = validate(info.intrinsics); !valid) return tl::make_unexpected(valid.error());
  if (auto made = make_folder(folder); !made) return tl::make_unexpected(made.error());
  Recorder recorder;
  recorder.folder_ = folder;
  recorder.info_ = info;
  // depth.txt first: its mark makes the folder ours even when we are killed right after.
  recorder.depth_list_.open(folder / "depth.txt");
  if (auto marked = recorder.append(recorder.depth_list_, "depth.txt", fmt::format("{}\n", kMark)); !marked) {
    return tl::make_unexpected(marked.error());
  }
  std::ofstream camera(folder / "camera_info.yaml");
  const std::string yaml = camera_info_yaml(info.intrinsics, info.metres_per_unit);
  if (auto written = recorder.append(camera, "camera_info.yaml", yaml); !written) {
    return tl::make_unexpected(written.error());
  }
  return recorder;
}

Expected<void> Recorder::append(std::ofstream& file, const char* name, const std::string& text) {
  if (file) file << text << std::flush;
  if (!file) return cannot(folder_ / name, "written", std::strerror(errno));
  return {};
}

Expected<void> Recorder::write(const DepthFrame& frame) {
  if (frame.width != info_.intrinsics.width || frame.height != info_.intrinsics.height ||
      frame.metres_per_unit != info_.metres_per_unit) {
    return tl::make_unexpected(Error::failed(fmt::format(
        "{}: frame {}: got {} x {} pixels of {:g} m, takes {} x {} of {:g} m; record it to a folder of its own",
        folder_.string(), frame.index, frame.width, frame.height, frame.metres_per_unit, info_.intrinsics.width,
        info_.intrinsics.height, info_.metres_per_unit)));
  }
  const std::string name = fmt::format("depth/{:06d}.png", frames_written_);
  if (auto written = write_depth_png(folder_ / name, frame); !written) return written;
  // The pose before the frame's line: a frame that is listed has all that belongs to it.
  if (frame.world_from_camera) {
    std::string text = pose_line(frame.timestamp_s, *frame.world_from_camera);
    if (!pose_list_.is_open()) {
      pose_list_.open(folder_ / "groundtruth.txt");
      text.insert(0, "# world_from_camera: timestamp tx ty tz qx qy qz qw\n");
    }
    if (auto written = append(pose_list_, "groundtruth.txt", text); !written) return written;
  }
  auto listed = append(depth_list_, "depth.txt", fmt::format("{} {}\n", frame.timestamp_s, name));
  if (listed) ++frames_written_;
  return listed;
}

}  // namespace tubetrack
