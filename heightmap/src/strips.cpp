#include "strips.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <bit>
#include <cmath>
#include <iterator>
#include <optional>

namespace tubetrack {

namespace {

constexpr int kAside = 6;                // lines to either side, between which a strip's direction is seen
constexpr int kBackgroundWithin = 6;     // cells beyond a silhouette; nothing returns there: it is far behind
constexpr float kSteepest = 1.2F;        // a strip that crosses lines at a smaller angle is found across the other ones
constexpr float kLostAtEdges_px = 0.7F;  // on average, by drop-out

/// The cells of a strip's line, rows (across false) or columns.
struct Lines {
  const HeightMap& map;
  const Heights& heights;
  bool columns;

  int count() const { return columns ? map.intrinsics.width : map.intrinsics.height; }
  int length() const { return columns ? map.intrinsics.height : map.intrinsics.width; }
  int u(int line, int at) const { return columns ? line : at; }
  int v(int line, int at) const { return columns ? at : line; }
  std::size_t cell(int line, int at) const { return map.cell(u(line, at), v(line, at)); }
  /// 0: none.
  float depth_m(int line, int at) const {
    const std::int32_t height = heights.height[heights.grid.at(u(line, at), v(line, at))];
    return height > 0 ? 1.0F / (static_cast<float>(height) * kHeightUnit_per_m) : 0.0F;
  }
};

/// Is what lies beyond one end of a run far enough behind? Beyond the image nothing is known.
bool is_before_background(const Lines& lines, const StripRun& run, int from, int step, float least_m) {
  for (int i = 0; i < kBackgroundWithin; ++i) {
    const int at = from + i * step;
    if (at < 0 || at >= lines.length()) return false;
    const float depth_m = lines.depth_m(run.line, at);
    if (depth_m > 0.0F) return depth_m - run.depth_m > least_m;
  }
  return true;
}

/// Keeps a run that is as wide as wanted and stands out.
void add_run(const Lines& lines, StripRun run, const SurfelOptions& options, std::vector<StripRun>& out) {
  const int cells = run.end - run.begin;
  const float widest = static_cast<float>(options.widest_strip_px) * 1.56F;  // √(1 + kSteepest²)
  if (cells + 2 < static_cast<int>(options.narrowest_strip_px) || static_cast<float>(cells) > widest) return;
  float sum_m = 0.0F;
  for (int at = run.begin; at < run.end; ++at) sum_m += lines.depth_m(run.line, at);
  run.depth_m = sum_m / static_cast<float>(cells);
  const float half_width_m =
      0.5F * static_cast<float>(cells) * run.depth_m / static_cast<float>(lines.map.intrinsics.fx_px);
  const float least_m = 0.5F * half_width_m;
  if (is_before_background(lines, run, run.begin - 1, -1, least_m) &&
      is_before_background(lines, run, run.end, 1, least_m))
    out.push_back(run);
}

void runs_of_rows(const Lines& lines, const Edges& edges, const Part& rows, const SurfelOptions& options,
                  std::vector<StripRun>& out) {
  for (int v = rows.begin; v < rows.end; ++v) {
    const std::uint64_t* valid = edges.valid.row(v);
    const std::uint64_t* right = edges.right.row(v);
    int begin = 0;
    for (int i = 1; i + 1 < edges.valid.grid.words(); ++i) {
      const std::uint64_t goes_on = valid[i] & ~right[i] & (valid[i] >> 1 | valid[i + 1] << 63);
      const std::uint64_t came = goes_on << 1 | (valid[i - 1] & ~right[i - 1] & valid[i] << 63) >> 63;
      const std::uint64_t begins = valid[i] & ~came;
      const std::uint64_t ends = valid[i] & ~goes_on;
      for (std::uint64_t bits = begins | ends; bits != 0; bits &= bits - 1) {
        const std::uint64_t bit = bits & (~bits + 1);
        const int u = 64 * i + std::countr_zero(bits) - kMargin_px;
        if (begins & bit) begin = u;
        if (ends & bit) add_run(lines, {v, begin, u + 1, 0.0F}, options, out);
      }
    }
  }
}

void runs_of_columns(const Lines& lines, const Edges& edges, const Part& rows, const SurfelOptions& options,
                     std::vector<int>& open, std::vector<StripRun>& out) {
  const int height = lines.length();
  const int words = edges.valid.grid.words();
  open.assign(static_cast<std::size_t>(lines.count()), 0);
  for (int v = rows.begin; v < rows.end; ++v) {
    const std::uint64_t* valid = edges.valid.row(v);
    const std::uint64_t* down = edges.down.row(v);
    const std::uint64_t* valid_above = v > 0 ? edges.valid.row(v - 1) : nullptr;
    const std::uint64_t* down_above = v > 0 ? edges.down.row(v - 1) : nullptr;
    const std::uint64_t* valid_below = v + 1 < height ? edges.valid.row(v + 1) : nullptr;
    for (int i = 1; i + 1 < words; ++i) {
      const std::uint64_t below = valid_below ? valid_below[i] : 0;
      const std::uint64_t above = valid_above ? valid_above[i] & ~down_above[i] : 0;
      const std::uint64_t begins = valid[i] & ~above;
      const std::uint64_t ends = valid[i] & ~(~down[i] & below);
      for (std::uint64_t bits = begins | ends; bits != 0; bits &= bits - 1) {
        const std::uint64_t bit = bits & (~bits + 1);
        const int u = 64 * i + std::countr_zero(bits) - kMargin_px;
        int& begin = open[static_cast<std::size_t>(u)];
        if (begins & bit) begin = v;
        if (ends & bit) add_run(lines, {u, begin, v + 1, 0.0F}, options, out);
      }
    }
  }
  std::ranges::sort(
      out, [](const StripRun& a, const StripRun& b) { return a.line != b.line ? a.line < b.line : a.begin < b.begin; });
}

float middle_of(const StripRun& run) {
  return 0.5F * static_cast<float>(run.begin + run.end - 1);
}

/// The run that goes on from this one some lines away, if one does, as wide and as far.
const StripRun* run_aside(const StripWork& work, std::span<const StripRun> runs, const StripRun& run, int line) {
  if (line < 0 || line + 1 >= static_cast<int>(work.first_of_line.size())) return nullptr;
  const auto cells = static_cast<float>(run.end - run.begin);
  const std::size_t end = work.first_of_line[static_cast<std::size_t>(line) + 1];
  for (std::size_t i = work.first_of_line[static_cast<std::size_t>(line)]; i < end; ++i) {
    const StripRun& other = runs[i];
    const float off = std::abs(middle_of(other) - middle_of(run));
    const float wider = static_cast<float>(other.end - other.begin) - cells;
    if (off < kSteepest * kAside && std::abs(wider) < 2.0F + 0.2F * cells &&
        std::abs(other.depth_m - run.depth_m) < 0.04F * run.depth_m)
      return &other;
  }
  return nullptr;
}

/// A piece of strip as a tube: its axis and how wide it is across that.
struct StripPiece {
  float middle = 0.0F;
  float half_width_px = 0.0F;
  float cosine = 1.0F;  ///< of the strip's turn out of the direction across the lines
  Eigen::Vector3f axis = Eigen::Vector3f::UnitX();
};

std::optional<StripPiece> piece_of(const Lines& lines, const StripRun& run, const StripRun& before,
                                   const StripRun& after) {
  StripPiece piece;
  piece.middle = (middle_of(before) + middle_of(run) + middle_of(after)) / 3.0F;
  if (std::abs(middle_of(before) + middle_of(after) - 2.0F * middle_of(run)) > 3.0F) return std::nullopt;
  const float slope = (middle_of(after) - middle_of(before)) / (2.0F * kAside);
  piece.cosine = 1.0F / std::sqrt(1.0F + slope * slope);
  const auto cells = static_cast<float>(before.end - before.begin + run.end - run.begin + after.end - after.begin);
  piece.half_width_px = 0.5F * (cells / 3.0F + kLostAtEdges_px) * piece.cosine;
  const auto point = [&](const StripRun& at) -> Eigen::Vector3f {
    const Eigen::Vector2f& ray = lines.map.rays[lines.cell(at.line, (at.begin + at.end) / 2)];
    return {ray.x() * at.depth_m, ray.y() * at.depth_m, at.depth_m};
  };
  const Eigen::Vector3f way = point(after) - point(before);
  const float length = way.norm();
  if (length <= 0.0F) return std::nullopt;
  piece.axis = way / length;
  return piece;
}

void add_surfels(const Lines& lines, const StripRun& run, const StripPiece& piece, const Part& rows,
                 const AxialNoise& noise, const SurfelOptions& options, std::vector<Surfel>& out) {
  const float radius_m = piece.half_width_px * run.depth_m / static_cast<float>(lines.map.intrinsics.fx_px);
  const auto low = std::max(0.75F * radius_m, static_cast<float>(options.radius_min_m));
  const auto high = std::min(1.3F * radius_m, static_cast<float>(options.radius_max_m));
  if (low > high) return;
  for (int at = run.begin; at < run.end; ++at) {
    const float lateral = (static_cast<float>(at) - piece.middle) * piece.cosine / piece.half_width_px;
    const int v = lines.v(run.line, at);
    if (std::abs(lateral) > 0.9F || v < rows.begin || v >= rows.end) continue;
    const std::size_t cell = lines.cell(run.line, at);
    const Eigen::Vector3f ray(lines.map.rays[cell].x(), lines.map.rays[cell].y(), 1.0F);
    Eigen::Vector3f across = piece.axis.cross(ray).normalized();
    if (across[lines.columns ? 1 : 0] < 0.0F) across = -across;
    Eigen::Vector3f inward = across.cross(piece.axis);
    if (inward.z() < 0.0F) inward = -inward;
    Surfel surfel;
    const float z = lines.depth_m(run.line, at);
    surfel.position_m = ray * z;
    surfel.inward_normal = std::sqrt(1.0F - lateral * lateral) * inward - lateral * across;
    const float off = z - noise.reference_m;
    const float gauss = noise.constant_m + noise.quadratic_per_m * off * off;
    surfel.sigma_m = std::sqrt(gauss * gauss + z * z * z * z * noise.rounding_variance_per_m2);
    surfel.radius_min_m = low;
    surfel.radius_max_m = high;
    surfel.cell = static_cast<std::uint32_t>(cell);
    out.push_back(surfel);
  }
}

void add_strips(const Lines& lines, std::span<const StripRun> runs, const Part& rows, const AxialNoise& noise,
                const SurfelOptions& options, std::span<const std::uint8_t> skip, StripWork& work,
                std::vector<Surfel>& out) {
  work.first_of_line.assign(static_cast<std::size_t>(lines.count()) + 1, 0);
  for (const StripRun& run : runs) ++work.first_of_line[static_cast<std::size_t>(run.line) + 1];
  for (std::size_t i = 1; i < work.first_of_line.size(); ++i) work.first_of_line[i] += work.first_of_line[i - 1];
  for (const StripRun& run : runs) {
    if (!skip.empty() && skip[lines.cell(run.line, (run.begin + run.end) / 2)] != 0) continue;
    const StripRun* before = run_aside(work, runs, run, run.line - kAside);
    const StripRun* after = before ? run_aside(work, runs, run, run.line + kAside) : nullptr;
    if (!after) continue;
    const auto piece = piece_of(lines, run, *before, *after);
    if (!piece) continue;
    const float width_px = 2.0F * piece->half_width_px;
    if (width_px < static_cast<float>(options.narrowest_strip_px) ||
        width_px > static_cast<float>(options.widest_strip_px))
      continue;
    add_surfels(lines, run, *piece, rows, noise, options, out);
  }
}

}  // namespace

std::span<const Surfel> strip_surfels(const HeightMap& map, const Heights& heights, const Edges& edges,
                                      const Part& rows, const AxialNoise& noise, const SurfelOptions& options,
                                      std::span<const std::uint8_t> skip, bool changed, StripWork& work) {
  // Strips may be rare: their first frame should ask for no memory either.
  const std::size_t room = map.rays.size() / 16;
  for (std::vector<StripRun>* runs : {&work.row_runs, &work.column_runs}) runs->reserve(room);
  for (std::vector<Surfel>* surfels : {&work.of_rows, &work.of_columns, &work.surfels}) surfels->reserve(room);
  const Lines along_rows{map, heights, false};
  const Lines along_columns{map, heights, true};
  if (changed || work.rows != rows || work.narrowest_px != options.narrowest_strip_px ||
      work.widest_px != options.widest_strip_px) {
    const auto with_beside = [&](int px) {
      return Part{std::max(0, rows.begin - px), std::min(map.intrinsics.height, rows.end + px)};
    };
    work.rows = rows;
    work.narrowest_px = options.narrowest_strip_px;
    work.widest_px = options.widest_strip_px;
    work.row_runs.clear();
    work.column_runs.clear();
    runs_of_rows(along_rows, edges, with_beside(kAside), options, work.row_runs);
    runs_of_columns(along_columns, edges, with_beside(kEdgesForStrips_px), options, work.open, work.column_runs);
  }
  work.of_rows.clear();
  work.of_columns.clear();
  add_strips(along_rows, work.row_runs, rows, noise, options, skip, work, work.of_rows);
  add_strips(along_columns, work.column_runs, rows, noise, options, skip, work, work.of_columns);
  std::ranges::sort(work.of_columns, {}, &Surfel::cell);  // of the rows they are in cell order
  // Of two in one cell the rows' stays.
  work.surfels.clear();
  std::ranges::set_union(work.of_rows, work.of_columns, std::back_inserter(work.surfels), {}, &Surfel::cell,
                         &Surfel::cell);
  return work.surfels;
}

}  // namespace tubetrack
