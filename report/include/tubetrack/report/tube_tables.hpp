#pragma once

#include <span>
#include <string>

#include "tubetrack/tracker/tube.hpp"

namespace tubetrack {

// Tables of tubes as text, a header line first, metres and radians, points in the frame of the tubes.

/// A row a node: tube, node, x_m, y_m, z_m, radius_m, sigma_m, along_m (from the tube's start).
std::string centerline_csv(std::span<const Tube> tubes);

/// XYZ: a row a point of the bend table: tube, point, x_m, y_m, z_m. Tubes without a bend table have no rows.
std::string xyz_csv(std::span<const Tube> tubes);

/// LRA: a row a bend and one for the closing length: tube, bend, length_m, rotation_rad, angle_rad, bend_radius_m
/// (empty in the closing row), their sigmas, ill_conditioned (0 or 1).
std::string lra_csv(std::span<const Tube> tubes);

/// Legacy VTK polydata: a polyline a tube; point data radius_m and sigma_m, cell data tube.
std::string vtk_polydata(std::span<const Tube> tubes);

}  // namespace tubetrack
