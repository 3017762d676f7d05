#include <fmt/format.h>

#include "pose_track.hpp"
#include "recorded_sequence.hpp"
#include "text_lines.hpp"

namespace tubetrack {

namespace {

constexpr std::size_t kQuoted = 60;  // of a broken line

Expected<void> read_depth_list(const std::filesystem::path& folder, RecordedSequence& sequence) {
  const std::filesystem::path list = folder / "depth.txt";
  const auto lines = read_text_lines(list);
  if (!lines) return tl::make_unexpected(lines.error());
  for (const TextLine& line : *lines) {
    std::string_view rest = line.text;
    const auto timestamp_s = parse_number(take_word(rest));
    if (timestamp_s && !rest.empty()) {
      sequence.frames.push_back(
          {folder / rest, *timestamp_s, std::nullopt, fmt::format("{}:{}", list.string(), line.number)});
    } else if (line.unfinished) {
      sequence.notes.push_back(
          fmt::format("{}:{}: the last line is cut short and left out", list.string(), line.number));
    } else {
      return tl::make_unexpected(Error::failed(fmt::format("{}:{}: got \"{}\", takes: timestamp filename",
                                                           list.string(), line.number, line.text.substr(0, kQuoted))));
    }
  }
  if (sequence.frames.empty()) {
    return tl::make_unexpected(
        Error::failed(fmt::format("{}: no frames in it; takes a line \"timestamp filename\" for each", list.string())));
  }
  return {};
}

Expected<void> read_poses(const std::filesystem::path& file, RecordedSequence& sequence) {
  const auto track = read_pose_track(file);
  if (!track) return tl::make_unexpected(track.error());
  sequence.has_poses = true;
  for (RecordedFrame& frame : sequence.frames) frame.world_from_camera = pose_at(*track, frame.timestamp_s);
  return {};
}

}  // namespace

Expected<RecordedSequence> read_tum_recording(const std::filesystem::path& folder) {
  RecordedSequence sequence;
  sequence.path = folder;
  if (auto listed = read_depth_list(folder, sequence); !listed) return tl::make_unexpected(listed.error());
  std::error_code ignored;
  sequence.camera_file = folder / "camera_info.yaml";
  if (std::filesystem::exists(sequence.camera_file, ignored)) {
    auto camera = read_camera_info(sequence.camera_file);
    if (!camera) return tl::make_unexpected(camera.error());
    sequence.camera = *camera;
  }
  const std::filesystem::path poses = folder / "groundtruth.txt";
  if (std::filesystem::exists(poses, ignored)) {
    if (auto read = read_poses(poses, sequence); !read) return tl::make_unexpected(read.error());
  }
  return sequence;
}

}  // namespace tubetrack
