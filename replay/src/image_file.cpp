#include "image_file.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <cerrno>
#include <cstring>
#include <fstream>
#include <iterator>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>
#include <string_view>
#include <vector>

namespace tubetrack {

namespace {

constexpr std::string_view kFix = "record or copy it again, or take it out of the recording";

tl::unexpected<ImageProblem> unreadable(const std::filesystem::path& path, std::string_view why) {
  return tl::make_unexpected(
      ImageProblem{ImageProblem::Kind::unreadable, fmt::format("{}: {}; {}", path.string(), why, kFix)});
}

/// A PNG cut short. Looked at before decoding because libpng would print its own complaint.
bool is_truncated_png(std::string_view bytes) {
  return bytes.substr(0, 4) == "\x89PNG" && bytes.rfind("IEND") == std::string_view::npos;
}

int bits_per_channel(const cv::Mat& image) {
  return static_cast<int>(image.elemSize1()) * 8;
}

}  // namespace

tl::expected<DepthImage, ImageProblem> read_depth_image(const std::filesystem::path& path) {
  std::error_code ignored;
  if (std::filesystem::is_directory(path, ignored)) return unreadable(path, "is a directory, not an image");
  std::ifstream file(path, std::ios::binary);
  if (!file) return unreadable(path, fmt::format("cannot be opened: {}", std::strerror(errno)));
  const std::vector<char> bytes((std::istreambuf_iterator<char>(file)), std::istreambuf_iterator<char>());
  if (bytes.empty()) return unreadable(path, "is empty (0 bytes)");
  if (is_truncated_png({bytes.data(), bytes.size()})) {
    return unreadable(path, fmt::format("truncated PNG (ends after {} bytes)", bytes.size()));
  }
  auto image = std::make_shared<cv::Mat>();
  try {
    *image = cv::imdecode(cv::Mat(1, static_cast<int>(bytes.size()), CV_8U, const_cast<char*>(bytes.data())),
                          cv::IMREAD_UNCHANGED);
  } catch (const std::exception&) {
    image->release();
  }
  if (image->empty()) return unreadable(path, "cannot be decoded (damaged or truncated, or no PNG, TIFF or PGM)");
  if (image->type() != CV_16UC1) {
    return tl::make_unexpected(ImageProblem{
        ImageProblem::Kind::wrong_type,
        fmt::format(
            "{}: {}-bit with {} channel(s), takes 16-bit with 1 channel; export the raw depth, not a picture of it",
            path.string(), bits_per_channel(*image), image->channels())});
  }
  return DepthImage{image->ptr<std::uint16_t>(), image->cols, image->rows, image->step[0], image};
}

bool has_depth_image_extension(const std::filesystem::path& path) {
  std::string extension = path.extension().string();
  std::transform(extension.begin(), extension.end(), extension.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  constexpr std::array<std::string_view, 4> known = {".png", ".tif", ".tiff", ".pgm"};
  return std::find(known.begin(), known.end(), extension) != known.end();
}

Expected<void> write_depth_png(const std::filesystem::path& path, const DepthFrame& frame) {
  const auto failed = [&](std::string_view why) {
    return tl::make_unexpected(Error::failed(fmt::format("{}: {}", path.string(), why)));
  };
  std::vector<std::uint8_t> bytes;
  try {
    const cv::Mat view(frame.height, frame.width, CV_16UC1, const_cast<std::uint16_t*>(frame.pixels),
                       frame.stride_bytes);
    // Level 1: a live recorder has a few milliseconds a frame; 9 saves a tenth of the size for ten times the time.
    if (!cv::imencode(".png", view, bytes, {cv::IMWRITE_PNG_COMPRESSION, 1})) return failed("cannot be encoded as PNG");
  } catch (const std::exception& error) {
    return failed(fmt::format("cannot be encoded as PNG ({} x {} pixels)", frame.width, frame.height));
  }
  std::filesystem::path temporary = path;
  temporary += ".tmp";
  std::ofstream file(temporary, std::ios::binary);
  file.write(reinterpret_cast<const char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
  file.close();
  std::error_code error;
  if (file) std::filesystem::rename(temporary, path, error);
  if (!file || error) {
    const std::string reason = error ? error.message() : std::strerror(errno);
    std::filesystem::remove(temporary, error);
    return failed(fmt::format("cannot be written: {}; check the free space and the rights", reason));
  }
  return {};
}

}  // namespace tubetrack
