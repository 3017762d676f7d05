#include "tubetrack/tracker/predict.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <optional>
#include <tuple>

#include "predict_row.hpp"
#include "tubetrack/tracker/recycled.hpp"

namespace tubetrack {

namespace {

/// A short straight piece of the tube, cut off by the mitre planes it shares with its neighbours.
struct Piece {
  Eigen::Vector3d start_m, end_m;
  Eigen::Vector3d axis;                    ///< unit
  Eigen::Vector3d start_mitre, end_mitre;  ///< normals of the planes, per metre along this piece's axis
  double t_start = 0.0;
  double t_length = 0.0;
  double radius_m = 0.0;
};

constexpr double kSpansPerPiece = 0.5;
constexpr int kMostStepsPerPiece = 8;            // where the line is straight
constexpr double kSpansPerVaryingPiece = 0.125;  // a taper of 10 % is a step of 1.5 % of the radius then

/// How many steps from `first` on one straight piece may stand for.
int steps_in_line(const RecycledVector<Eigen::Vector3d>& points_m, int first, double off_m) {
  const auto at = [&](int i) -> const Eigen::Vector3d& { return points_m[static_cast<std::size_t>(i)]; };
  const int most = std::min(kMostStepsPerPiece, static_cast<int>(points_m.size()) - 1 - first);
  for (int steps = 2; steps <= most; ++steps) {
    const Eigen::Vector3d step = (at(first + steps) - at(first)) / steps;
    for (int i = 1; i < steps; ++i) {
      if ((at(first + i) - at(first) - i * step).squaredNorm() > off_m * off_m) return steps - 1;
    }
  }
  return std::max(1, most);
}

RecycledVector<Piece> cut_into_pieces(const TubeModel& model, double straight_radii) {
  const bool varies = !model.profile.offset_m.empty();
  const double spans_per_step = varies ? kSpansPerVaryingPiece : kSpansPerPiece;
  const int count = static_cast<int>(std::lround(model.spline.spans() / spans_per_step));
  RecycledVector<Eigen::Vector3d> points_m(static_cast<std::size_t>(count + 1));
  for (int i = 0; i <= count; ++i) points_m[static_cast<std::size_t>(i)] = point_at(model.spline, spans_per_step * i);
  RecycledVector<Piece> pieces;
  pieces.reserve(static_cast<std::size_t>(count));
  int steps = 1;
  for (int i = 0; i < count; i += steps) {
    steps = varies || straight_radii <= 0.0 ? 1 : steps_in_line(points_m, i, straight_radii * model.radius_m);
    Piece piece;
    piece.start_m = points_m[static_cast<std::size_t>(i)];
    piece.end_m = points_m[static_cast<std::size_t>(i) + static_cast<std::size_t>(steps)];
    const double length_m = (piece.end_m - piece.start_m).norm();
    if (length_m < 1e-6) continue;
    piece.axis = (piece.end_m - piece.start_m) / length_m;
    piece.t_start = spans_per_step * i;
    piece.t_length = spans_per_step * steps;
    piece.radius_m = radius_at(model, piece.t_start + 0.5 * piece.t_length);
    piece.start_mitre = piece.end_mitre = piece.axis;
    pieces.push_back(piece);
  }
  for (std::size_t i = 1; i < pieces.size(); ++i) {
    const Eigen::Vector3d mitre = pieces[i - 1].axis + pieces[i].axis;
    if (mitre.squaredNorm() < 0.5) continue;  // folded back on itself: cut straight
    pieces[i - 1].end_mitre = mitre / mitre.dot(pieces[i - 1].axis);
    pieces[i].start_mitre = mitre / mitre.dot(pieces[i].axis);
  }
  return pieces;
}

/// A piece's outline in the image: a quadrangle around it, a little too large.
using Quad = std::array<Eigen::Vector2d, 4>;

/// How far a circle of the tube around `center_m` reaches in the image along a unit direction.
double reach_px(const Intrinsics& in, const Eigen::Vector3d& center_m, const Piece& piece, double radius_m,
                const Eigen::Vector2d& direction) {
  const double z = center_m.z() - radius_m;
  Eigen::Matrix<double, 2, 3> by_point;
  by_point << in.fx_px / z, 0.0, -in.fx_px * center_m.x() / (z * center_m.z()), 0.0, in.fy_px / z,
      -in.fy_px * center_m.y() / (z * center_m.z());
  const Eigen::Vector3d gradient = by_point.transpose() * direction;
  return radius_m * (gradient - gradient.dot(piece.axis) * piece.axis).norm();
}

std::optional<Quad> outline_of(const Intrinsics& in, const Piece& piece, double radius_m) {
  if (std::min(piece.start_m.z(), piece.end_m.z()) - radius_m < 0.02) return std::nullopt;
  const Eigen::Vector2d from = project(in, piece.start_m);
  const Eigen::Vector2d to = project(in, piece.end_m);
  Eigen::Vector2d along = to - from;
  along = along.norm() > 1e-6 ? Eigen::Vector2d(along.normalized()) : Eigen::Vector2d::UnitX();
  const Eigen::Vector2d side(-along.y(), along.x());
  const auto reach = [&](const Eigen::Vector3d& center, const Eigen::Vector2d& direction) {
    return 1.1 * reach_px(in, center, piece, radius_m, direction) + 1.5;
  };
  // A mitre plane that leans by an angle goes up to R tan(angle) beyond the end.
  const auto lean = [&](const Eigen::Vector3d& center, const Eigen::Vector3d& mitre) {
    return 1.1 * (mitre - piece.axis).norm() * reach_px(in, center, piece, radius_m, side);
  };
  const double back = reach(piece.start_m, along) + lean(piece.start_m, piece.start_mitre);
  const double front = reach(piece.end_m, along) + lean(piece.end_m, piece.end_mitre);
  const double from_half = reach(piece.start_m, side);
  const double to_half = reach(piece.end_m, side);
  return Quad{from - back * along - from_half * side, to + front * along - to_half * side,
              to + front * along + to_half * side, from - back * along + from_half * side};
}

/// Pixels from begin to below end.
struct Range {
  int begin = 0;
  int end = 0;
};

/// The pixels of a row or column between two borders.
Range between(double low, double high, int size) {
  const double from = std::clamp(low, 0.0, 1.0 * size);
  const auto whole = static_cast<int>(from);
  return {from > whole ? whole + 1 : whole, static_cast<int>(std::clamp(high + 1.0, 0.0, 1.0 * size))};
}

/// A side of an outline: where it is in each row from `top` to `bottom`.
struct Edge {
  double top = 0.0, bottom = -1.0;  ///< rows; below 0 long where it lies along a row: its ends are those of others
  double u_top = 0.0, u_per_row = 0.0;
};

/// A piece with its outline.
struct Outlined {
  RowPiece piece;
  std::array<Edge, 4> edges;
  float radius_m;
};

/// Those of a tube, and of each the rows of the image in which it may be seen.
struct OutlinedTube {
  RecycledVector<Outlined> pieces;
  RecycledVector<Range> rows;
  Range all_rows;
  RecycledVector<std::size_t> here;  ///< which may be seen in the rows that are looked at
};

/// All rows would ask all pieces.
void look_from(int v, int rows, OutlinedTube& outlined) {
  outlined.here.clear();
  for (std::size_t k = 0; k < outlined.rows.size(); ++k) {
    if (outlined.rows[k].begin < v + rows && outlined.rows[k].end > v) outlined.here.push_back(k);
  }
}

std::array<Edge, 4> edges_of(const Quad& quad) {
  std::array<Edge, 4> edges;
  for (std::size_t i = 0; i < 4; ++i) {
    const Eigen::Vector2d& a = quad[i];
    const Eigen::Vector2d& b = quad[(i + 1) % 4];
    const auto& [upper, lower] = a.y() < b.y() ? std::tie(a, b) : std::tie(b, a);
    const double rows = lower.y() - upper.y();
    if (rows > 0.0) edges[i] = {upper.y(), lower.y(), upper.x(), (lower.x() - upper.x()) / rows};
  }
  return edges;
}

RowPiece row_piece(const Piece& piece) {
  const Eigen::Vector3d middle_m = 0.5 * (piece.start_m + piece.end_m);
  const Eigen::Vector3f middle = middle_m.cast<float>();
  const Eigen::Vector3f axis = piece.axis.cast<float>();
  const Eigen::Vector3f start = piece.start_mitre.cast<float>();
  const Eigen::Vector3f end = piece.end_mitre.cast<float>();
  RowPiece row;
  row.middle_x_m = middle.x(), row.middle_y_m = middle.y(), row.middle_z_m = middle.z();
  row.axis_x = axis.x(), row.axis_y = axis.y(), row.axis_z = axis.z();
  row.start_x = start.x(), row.start_y = start.y(), row.start_z = start.z();
  row.end_x = end.x(), row.end_y = end.y(), row.end_z = end.z();
  row.start_off_m = static_cast<float>((middle_m - piece.start_m).dot(piece.start_mitre));
  row.end_off_m = static_cast<float>((piece.end_m - middle_m).dot(piece.end_mitre));
  row.t_start = static_cast<float>(piece.t_start);
  row.t_length = static_cast<float>(piece.t_length);
  return row;
}

OutlinedTube outline_all(const Intrinsics& in, const TubeModel& model, double straight_radii) {
  OutlinedTube all;
  all.all_rows = {in.height, 0};
  for (const Piece& piece : cut_into_pieces(model, straight_radii)) {
    const std::optional<Quad> quad = outline_of(in, piece, piece.radius_m);
    if (!quad) continue;
    const auto [top, bottom] = std::minmax({(*quad)[0].y(), (*quad)[1].y(), (*quad)[2].y(), (*quad)[3].y()});
    const Range rows = between(top, bottom, in.height);
    all.pieces.push_back({row_piece(piece), edges_of(*quad), static_cast<float>(piece.radius_m)});
    all.rows.push_back(rows);
    all.all_rows = {std::min(all.all_rows.begin, rows.begin), std::max(all.all_rows.end, rows.end)};
  }
  return all;
}

/// Where a row passes through an outline.
Range columns_in(const std::array<Edge, 4>& edges, int v, int width) {
  double left = 1e9, right = -1e9;
  for (const Edge& edge : edges) {
    if (edge.top > v || edge.bottom < v) continue;
    const double u = edge.u_top + (v - edge.top) * edge.u_per_row;
    left = std::min(left, u);
    right = std::max(right, u);
  }
  return between(left, right, width);
}

/// The first multiple of the stride from `from` on, over the stride.
int divided_up(int from, int stride) {
  return stride == 1 ? from : (from + stride - 1) / stride;
}

/// Writes the rays of a row's pixels, in strides. Without distortion those of a column have the same x, so one row will
/// do for all, and those of a row the same y, which is not written here.
void take_rays(const HeightMap& map, bool distorted, int v, int stride, const Range& pixels, PredictedRow& row) {
  for (int i = pixels.begin; i < pixels.end; ++i) {
    const Eigen::Vector2f& ray = map.rays[map.cell(i * stride, v)];
    row.ray_x[static_cast<std::size_t>(i)] = ray.x();
    if (distorted) row.ray_y[static_cast<std::size_t>(i)] = ray.y();
  }
}

/// Intersects the pixels of row v with every piece, and tells which pixels that may have been: in strides.
Range intersect_all(const HeightMap& map, bool distorted, const OutlinedTube& outlined, int v, int stride,
                    PredictedRow& row) {
  const int width = map.intrinsics.width;
  Range touched{width, 0};
  for (const std::size_t k : outlined.here) {
    if (v < outlined.rows[k].begin || v >= outlined.rows[k].end) continue;
    const Outlined& one = outlined.pieces[k];
    const Range columns = columns_in(one.edges, v, width);
    const int begin = divided_up(columns.begin, stride);
    const int end = divided_up(columns.end, stride);
    if (begin >= end) continue;
    if (distorted) take_rays(map, true, v, stride, {begin, end}, row);
    touched = {std::min(touched.begin, begin), std::max(touched.end, end)};
    intersect_row(one.piece, one.radius_m, begin, end, row);
  }
  return touched;
}

/// A row for this thread, met by nothing. Fresh buffers would cost as much as all else for a short piece.
PredictedRow& row_for(int pixels) {
  thread_local PredictedRow row;
  if (row.depth_m.size() < static_cast<std::size_t>(pixels)) row = make_row(pixels);
  return row;
}

}  // namespace

void PredictedPixels::make_room(std::size_t pixels) {
  const std::size_t room = pixels + kSpare;
  if (cell.size() >= room) return;
  // More than is asked for, so that most tubes' columns are of one size and are used again.
  const std::size_t reserved = std::max(room, std::size_t{16384});
  const auto widen = [&](auto& column) {
    if (column.capacity() < room) column.reserve(reserved);
    column.resize(room);
  };
  widen(cell);
  for (RecycledVector<float>* column :
       {&depth_m, &t, &cos_incidence, &lateral, &axis_depth_m, &across, &margin_px, &jitter_bias_m, &sigma_m})
    widen(*column);
}

void predict_pixels(const HeightMap& map, const NoiseModel& noise, const TubeModel& model, int stride,
                    PredictedPixels& pixels, double straight_radii) {
  const Intrinsics& in = map.intrinsics;
  constexpr int kRowsAtOnce = 16;
  OutlinedTube outlined = outline_all(in, model, straight_radii);
  const Range rows = outlined.all_rows;
  PredictedRow& row = row_for(in.width);
  const bool distorted = in.has_distortion();
  if (!distorted) take_rays(map, false, 0, stride, {0, divided_up(in.width, stride)}, row);
  pixels.count = 0;
  pixels.rows.clear();
  int looked_to = rows.begin;
  for (int v = divided_up(rows.begin, stride) * stride; v < rows.end; v += stride) {
    if (v >= looked_to) {
      look_from(v, kRowsAtOnce, outlined);
      looked_to = v + kRowsAtOnce;
    }
    row.same_y = distorted ? std::nullopt : std::optional<float>(map.rays[map.cell(0, v)].y());
    const Range touched = intersect_all(map, distorted, outlined, v, stride, row);
    if (touched.begin >= touched.end) continue;
    const std::size_t most = pixels.count + static_cast<std::size_t>(touched.end - touched.begin);
    if (pixels.cell.size() < most + PredictedPixels::kSpare) pixels.make_room(most + most / 2);
    const std::size_t first = pixels.count;
    take_row(noise, in.fx_px, model.radius_m, touched.begin, touched.end, map.cell(0, v), stride, row, pixels);
    if (pixels.count > first) pixels.rows.push_back(first);
  }
}

PredictedPixels predict_pixels(const HeightMap& map, const NoiseModel& noise, const TubeModel& model, int stride) {
  PredictedPixels pixels;
  predict_pixels(map, noise, model, stride, pixels);
  return pixels;
}

}  // namespace tubetrack
