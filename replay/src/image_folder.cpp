#include <fmt/format.h>

#include <algorithm>

#include "image_file.hpp"
#include "natural_sort.hpp"
#include "recorded_sequence.hpp"

namespace tubetrack {

namespace {

std::vector<std::filesystem::path> depth_images_in(const std::filesystem::path& folder, std::error_code& error) {
  std::vector<std::filesystem::path> images;
  for (std::filesystem::directory_iterator entry(folder, error), end; !error && entry != end; entry.increment(error)) {
    if (has_depth_image_extension(entry->path())) images.push_back(entry->path());
  }
  std::sort(images.begin(), images.end(),
            [](const auto& a, const auto& b) { return natural_less(a.filename().string(), b.filename().string()); });
  return images;
}

Expected<std::vector<std::filesystem::path>> list_images(const std::filesystem::path& path) {
  std::error_code error;
  if (!std::filesystem::is_directory(path, error)) return std::vector{path};
  auto images = depth_images_in(path, error);
  if (error) {
    return tl::make_unexpected(
        Error::failed(fmt::format("{}: cannot be listed: {}; check the rights", path.string(), error.message())));
  }
  if (!images.empty()) return images;
  std::string fix = "give a folder with depth.txt, scene_camera.json, or 16-bit .png, .tiff or .pgm images";
  if (!depth_images_in(path / "depth", error).empty()) {
    fix = fmt::format("its images are in {}: give that folder", (path / "depth").string());
  }
  return tl::make_unexpected(Error::failed(fmt::format("{}: no frames in this folder; {}", path.string(), fix)));
}

}  // namespace

Expected<RecordedSequence> read_image_folder(const std::filesystem::path& folder_or_image) {
  const auto images = list_images(folder_or_image);
  if (!images) return tl::make_unexpected(images.error());
  RecordedSequence sequence;
  sequence.path = folder_or_image;
  for (const auto& image : *images) {
    const double timestamp_s = static_cast<double>(sequence.frames.size()) / kAssumedFramesPerSecond;
    sequence.frames.push_back({image, timestamp_s, std::nullopt, image.string()});
  }
  std::error_code ignored;
  sequence.camera_file = images->front().parent_path() / "camera_info.yaml";
  if (std::filesystem::exists(sequence.camera_file, ignored)) {
    auto camera = read_camera_info(sequence.camera_file);
    if (!camera) return tl::make_unexpected(camera.error());
    sequence.camera = *camera;
  }
  if (images->size() > 1) {
    sequence.notes.push_back(
        fmt::format("{}: no timestamps, {:g} frames a second of one scene assumed; images of different scenes "
                    "are tracked one by one, by the file's name",
                    folder_or_image.string(), kAssumedFramesPerSecond));
  }
  return sequence;
}

}  // namespace tubetrack
