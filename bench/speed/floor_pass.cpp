#include "floor_pass.hpp"

#include <algorithm>
#include <cstddef>

namespace tubetrack::bench {

namespace {

constexpr int kHalf = kFloorBox_px / 2;

/// Means of one row from its column sums, each of `rows` readings.
void mean_row(const std::int32_t* columns, int width, int rows, float metres_per_unit, float* mean_m) {
  const auto at_border = [&](int u) {
    const int from = std::max(u - kHalf, 0);
    const int to = std::min(u + kHalf, width - 1);
    std::int32_t sum = 0;
    for (int i = from; i <= to; ++i) sum += columns[i];
    mean_m[u] = static_cast<float>(sum) * (metres_per_unit / static_cast<float>(rows * (to - from + 1)));
  };
  const int inner_end = std::max(width - kHalf, kHalf);
  for (int u = 0; u < std::min(kHalf, width); ++u) at_border(u);
  const float scale = metres_per_unit / static_cast<float>(rows * kFloorBox_px);
  for (int u = kHalf; u < inner_end; ++u) {
    std::int32_t sum = 0;
    for (int i = -kHalf; i <= kHalf; ++i) sum += columns[u + i];
    mean_m[u] = static_cast<float>(sum) * scale;
  }
  for (int u = inner_end; u < width; ++u) at_border(u);
}

/// Rows [band.begin, band.end) of what the pass writes.
void floor_band(const DepthFrame& frame, const Part& band, std::int32_t* columns, FloorPass& pass) {
  const auto width = static_cast<std::size_t>(frame.width);
  const auto unit_m = static_cast<float>(frame.metres_per_unit);
  std::fill(columns, columns + width, 0);
  const int first = std::max(band.begin - kHalf, 0);
  for (int v = first; v < band.end + kHalf; ++v) {
    if (v < frame.height) {
      const std::uint16_t* row = frame.row(v);
      for (std::size_t u = 0; u < width; ++u) columns[u] += row[u];
      if (v >= band.begin && v < band.end) {
        float* metres = pass.metres.data() + static_cast<std::size_t>(v) * width;
        for (std::size_t u = 0; u < width; ++u) metres[u] = static_cast<float>(row[u]) * unit_m;
      }
    }
    if (v - kFloorBox_px >= first) {
      const std::uint16_t* gone = frame.row(v - kFloorBox_px);
      for (std::size_t u = 0; u < width; ++u) columns[u] -= gone[u];
    }
    const int middle = v - kHalf;
    if (middle < band.begin) continue;
    const int rows = std::min(v, frame.height - 1) - std::max(middle - kHalf, 0) + 1;
    mean_row(columns, frame.width, rows, unit_m, pass.mean_m.data() + static_cast<std::size_t>(middle) * width);
  }
}

}  // namespace

void floor_pass(const DepthFrame& frame, FloorPass& pass, Workers& workers) {
  const auto width = static_cast<std::size_t>(frame.width);
  pass.metres.resize(width * static_cast<std::size_t>(frame.height));
  pass.mean_m.resize(pass.metres.size());
  pass.columns.resize(width * static_cast<std::size_t>(workers.count()));
  workers.run([&](int i) {
    floor_band(frame, part_of(frame.height, i, workers.count()),
               pass.columns.data() + static_cast<std::size_t>(i) * width, pass);
  });
}

}  // namespace tubetrack::bench
