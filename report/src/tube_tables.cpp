#include "tubetrack/report/tube_tables.hpp"

#include <fmt/format.h>

#include <iterator>

namespace tubetrack {

namespace {

double radius_at(const Tube& tube, std::size_t node) {
  return node < tube.node_radius_m.size() ? tube.node_radius_m[node] : tube.radius_m;
}

double sigma_at(const Tube& tube, std::size_t node) {
  return node < tube.sigma_m.size() ? tube.sigma_m[node] : 0.0;
}

}  // namespace

std::string centerline_csv(std::span<const Tube> tubes) {
  std::string text = "tube,node,x_m,y_m,z_m,radius_m,sigma_m,along_m\n";
  auto out = std::back_inserter(text);
  for (const Tube& tube : tubes) {
    double along_m = 0.0;
    for (std::size_t i = 0; i < tube.centerline_m.size(); ++i) {
      const Eigen::Vector3d& p = tube.centerline_m[i];
      if (i > 0) along_m += (p - tube.centerline_m[i - 1]).norm();
      fmt::format_to(out, "{},{},{:.7f},{:.7f},{:.7f},{:.7f},{:.3g},{:.7f}\n", tube.id, i, p.x(), p.y(), p.z(),
                     radius_at(tube, i), sigma_at(tube, i), along_m);
    }
  }
  return text;
}

std::string xyz_csv(std::span<const Tube> tubes) {
  std::string text = "tube,point,x_m,y_m,z_m\n";
  auto out = std::back_inserter(text);
  for (const Tube& tube : tubes) {
    for (std::size_t i = 0; i < tube.bend_table.xyz_m.size(); ++i) {
      const Eigen::Vector3d& p = tube.bend_table.xyz_m[i];
      fmt::format_to(out, "{},{},{:.7f},{:.7f},{:.7f}\n", tube.id, i, p.x(), p.y(), p.z());
    }
  }
  return text;
}

std::string lra_csv(std::span<const Tube> tubes) {
  std::string text =
      "tube,bend,length_m,rotation_rad,angle_rad,bend_radius_m,length_sigma_m,rotation_sigma_rad,angle_sigma_rad,"
      "bend_radius_sigma_m,ill_conditioned\n";
  auto out = std::back_inserter(text);
  for (const Tube& tube : tubes) {
    for (std::size_t i = 0; i < tube.bend_table.lra.size(); ++i) {
      const BendRow& row = tube.bend_table.lra[i];
      fmt::format_to(out, "{},{},{:.7f},{:.7f},{:.7f},", tube.id, i, row.length_m, row.rotation_rad, row.angle_rad);
      if (row.angle_rad > 0.0) fmt::format_to(out, "{:.7f}", row.bend_radius_m);
      fmt::format_to(out, ",{:.3g},{:.3g},{:.3g},{:.3g},{}\n", row.length_sigma_m, row.rotation_sigma_rad,
                     row.angle_sigma_rad, row.bend_radius_sigma_m, row.ill_conditioned ? 1 : 0);
    }
  }
  return text;
}

std::string vtk_polydata(std::span<const Tube> tubes) {
  std::size_t points = 0;
  for (const Tube& tube : tubes) points += tube.centerline_m.size();
  std::string text =
      fmt::format("# vtk DataFile Version 3.0\ntubetrack, metres\nASCII\nDATASET POLYDATA\nPOINTS {} double\n", points);
  auto out = std::back_inserter(text);
  for (const Tube& tube : tubes) {
    for (const Eigen::Vector3d& p : tube.centerline_m)
      fmt::format_to(out, "{:.7f} {:.7f} {:.7f}\n", p.x(), p.y(), p.z());
  }
  fmt::format_to(out, "LINES {} {}\n", tubes.size(), tubes.size() + points);
  std::size_t next = 0;
  for (const Tube& tube : tubes) {
    fmt::format_to(out, "{}", tube.centerline_m.size());
    for (std::size_t i = 0; i < tube.centerline_m.size(); ++i) fmt::format_to(out, " {}", next++);
    text += '\n';
  }
  fmt::format_to(out, "POINT_DATA {}\nSCALARS radius_m double 1\nLOOKUP_TABLE default\n", points);
  for (const Tube& tube : tubes) {
    for (std::size_t i = 0; i < tube.centerline_m.size(); ++i) fmt::format_to(out, "{:.7f}\n", radius_at(tube, i));
  }
  text += "SCALARS sigma_m double 1\nLOOKUP_TABLE default\n";
  for (const Tube& tube : tubes) {
    for (std::size_t i = 0; i < tube.centerline_m.size(); ++i) fmt::format_to(out, "{:.3g}\n", sigma_at(tube, i));
  }
  fmt::format_to(out, "CELL_DATA {}\nSCALARS tube int 1\nLOOKUP_TABLE default\n", tubes.size());
  for (const Tube& tube : tubes) fmt::format_to(out, "{}\n", tube.id);
  return text;
}

}  // namespace tubetrack
