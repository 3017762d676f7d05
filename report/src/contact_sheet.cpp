#include "tubetrack/report/contact_sheet.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

namespace tubetrack {

namespace {

constexpr int kGap_px = 3;

cv::Mat tile(const cv::Mat& picture, const std::string& label, cv::Size size) {
  cv::Mat small;
  cv::resize(picture, small, size, 0, 0, cv::INTER_AREA);
  small.forEach<cv::Vec3b>([](cv::Vec3b& p, const int*) {
    for (int c = 0; c < 3; ++c) p[c] = static_cast<unsigned char>(p[c] & 0xFC);
  });
  for (const auto& [color, thickness_px] : {std::pair(cv::Scalar::all(0), 3), std::pair(cv::Scalar::all(255), 1)}) {
    cv::putText(small, label, {5, 15}, cv::FONT_HERSHEY_SIMPLEX, 0.45, color, thickness_px, cv::LINE_AA);
  }
  return small;
}

}  // namespace

Expected<void> write_contact_sheet(const std::filesystem::path& path, std::span<const LabelledPicture> pictures,
                                   int columns, int tile_width_px) {
  if (pictures.empty() || columns < 1 || tile_width_px < 16) {
    return tl::make_unexpected(Error::usage("contact sheet: takes one picture or more, columns ≥ 1, tile width ≥ 16"));
  }
  try {
    cv::Mat sheet;
    cv::Size size;
    for (std::size_t i = 0; i < pictures.size(); ++i) {
      const cv::Mat picture = cv::imread(pictures[i].path.string(), cv::IMREAD_COLOR);
      if (picture.empty()) {
        return tl::make_unexpected(Error::failed(fmt::format("{}: is no picture", pictures[i].path.string())));
      }
      if (i == 0) {
        size = {tile_width_px, tile_width_px * picture.rows / picture.cols};
        const int rows = (static_cast<int>(pictures.size()) + columns - 1) / columns;
        sheet =
            cv::Mat(rows * (size.height + kGap_px), columns * (size.width + kGap_px), CV_8UC3, cv::Scalar::all(255));
      }
      const int row = static_cast<int>(i) / columns, column = static_cast<int>(i) % columns;
      const cv::Rect place({column * (size.width + kGap_px), row * (size.height + kGap_px)}, size);
      tile(picture, pictures[i].label, size).copyTo(sheet(place));
    }
    if (cv::imwrite(path.string(), sheet, {cv::IMWRITE_PNG_COMPRESSION, 9})) return {};
    return tl::make_unexpected(Error::failed(fmt::format("{}: cannot be written", path.string())));
  } catch (const cv::Exception& problem) {
    return tl::make_unexpected(Error::failed(fmt::format("{}: cannot be made: {}", path.string(), problem.err)));
  }
}

}  // namespace tubetrack
