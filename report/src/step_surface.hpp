#pragma once

#include <Eigen/Core>
#include <TopoDS_Face.hxx>
#include <TopoDS_Shape.hxx>
#include <gp_Ax2.hxx>
#include <gp_Dir.hxx>

#include "tubetrack/tracker/tube.hpp"

namespace tubetrack {

inline constexpr double kMillimetres = 1e3;  // what CAD programs expect; their tolerance of 1e-7 is of such units
// Shorter parts are none: points that near are the same to a CAD program.
inline constexpr double kNothing_mm = 1e-5;

gp_Dir direction(const Eigen::Vector3d& d);

/// A tube's section.
TopoDS_Face step_disc(const gp_Ax2& axes, double radius_mm);

/// A solid, in millimetres, whose surface goes through true circles at a tube's nodes, as thick as they are
/// (`node_radius_m`) or the tube is: two halves of its length, a closed one's sewn together at both ends, an open one's
/// with caps there. Null where there are fewer than three nodes.
TopoDS_Shape solid_through_nodes(const Tube& tube);

}  // namespace tubetrack
