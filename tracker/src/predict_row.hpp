#pragma once

#include <cstddef>
#include <optional>
#include <vector>

#include "tubetrack/sensors/noise_model.hpp"
#include "tubetrack/tracker/predict.hpp"

namespace tubetrack {

/// A straight piece of the tube between two planes, for intersection with rays z·(x, y, 1). Positions are relative to
/// `middle`, a point on the axis, so that floats resolve a tenth of a micrometre.
struct RowPiece {
  float middle_x_m = 0.0F, middle_y_m = 0.0F, middle_z_m = 0.0F;
  float axis_x = 0.0F, axis_y = 0.0F, axis_z = 0.0F;     ///< unit
  float start_x = 0.0F, start_y = 0.0F, start_z = 0.0F;  ///< normal of the plane at the start, towards the piece …
  float start_off_m = 0.0F;                              ///< … and how far `middle` is beyond it along that
  float end_x = 0.0F, end_y = 0.0F, end_z = 0.0F;        ///< the same at the end, away from the piece …
  float end_off_m = 0.0F;                                ///< … and how far `middle` is before it
  float t_start = 0.0F, t_length = 0.0F;
};

/// One row of pixels, each with its ray and where that meets the tube. Every buffer has room for a vector more than the
/// row's pixels.
struct PredictedRow {
  std::vector<float> ray_x, ray_y;
  std::optional<float> same_y;  ///< of all rays of the row; `ray_y` is not read then
  std::vector<float> depth_m;   ///< infinite: the tube is not met
  std::vector<float> t, axis_depth_m;
  // What takes roots and divisions is finished once all pieces were met.
  std::vector<float> slope;    ///< cosine of incidence, times the ray's length for one metre of z
  std::vector<float> swept;    ///< minus what is lateral, times across
  std::vector<float> across2;  ///< square of PredictedPixel's across
};
PredictedRow make_row(int pixels);

/// Takes into the row what of the piece is nearer than what is there, for pixels `begin` to below `end`.
void intersect_row(const RowPiece& piece, float radius_m, int begin, int end, PredictedRow& row);

/// Appends what pixels `begin` to below `end` of the row met, and makes the row ready for the next one. Its pixel 0 is
/// cell `first_cell`, the next `stride` cells on. There must be room.
void take_row(const NoiseModel& noise, double focal_px, double radius_m, int begin, int end, std::size_t first_cell,
              int stride, PredictedRow& row, PredictedPixels& pixels);

}  // namespace tubetrack
