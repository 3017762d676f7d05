#include "step_surface.hpp"

#include <BRepBuilderAPI_MakeEdge.hxx>
#include <BRepBuilderAPI_MakeFace.hxx>
#include <BRepBuilderAPI_MakeSolid.hxx>
#include <BRepBuilderAPI_MakeWire.hxx>
#include <BRepBuilderAPI_Sewing.hxx>
#include <BRepLib.hxx>
#include <Eigen/Geometry>
#include <GeomAPI_Interpolate.hxx>
#include <Geom_BSplineCurve.hxx>
#include <Geom_BSplineSurface.hxx>
#include <TColStd_Array1OfInteger.hxx>
#include <TColStd_Array1OfReal.hxx>
#include <TColStd_Array2OfReal.hxx>
#include <TColStd_HArray1OfReal.hxx>
#include <TColgp_Array2OfPnt.hxx>
#include <TColgp_HArray1OfPnt.hxx>
#include <TopoDS.hxx>
#include <TopoDS_Edge.hxx>
#include <TopoDS_Shell.hxx>
#include <TopoDS_Solid.hxx>
#include <TopoDS_Wire.hxx>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <gp_Circ.hxx>
#include <gp_Pnt.hxx>
#include <numbers>
#include <vector>

namespace tubetrack {

namespace {

/// A tube's section at a node: its centre, two axes across the line, and how thick it is there.
struct StepSection {
  Eigen::Vector3d center_mm, e1 = Eigen::Vector3d::UnitX(), e2 = Eigen::Vector3d::UnitY();
  double radius_mm = 0.0;
};

/// Sections at the nodes, turned as little as they can be from one to the next; around a closed line, whose first node
/// is not there again, by as much more as it takes to end as they began.
std::vector<StepSection> sections_of(const Tube& tube) {
  std::vector<StepSection> sections;
  for (std::size_t i = 0; i < tube.centerline_m.size(); ++i) {
    const Eigen::Vector3d center_mm = kMillimetres * tube.centerline_m[i];
    if (!sections.empty() && (center_mm - sections.back().center_mm).norm() <= kNothing_mm) continue;
    const double radius_m = tube.node_radius_m.empty() ? tube.radius_m : tube.node_radius_m[i];
    StepSection section{center_mm};
    section.radius_mm = kMillimetres * radius_m;
    sections.push_back(section);
  }
  if (tube.closed && sections.size() > 1) sections.pop_back();
  const auto count = static_cast<std::ptrdiff_t>(sections.size());
  if (count < 3) return sections;
  const auto center = [&](std::ptrdiff_t i) {
    return sections[static_cast<std::size_t>((i + count) % count)].center_mm;
  };
  // Of the parabola through a node and those beside it, or the next two at an end.
  const auto along = [&](std::ptrdiff_t i) -> Eigen::Vector3d {
    const std::ptrdiff_t middle = tube.closed ? i : std::clamp<std::ptrdiff_t>(i, 1, count - 2);
    const Eigen::Vector3d in_mm = center(middle) - center(middle - 1), out_mm = center(middle + 1) - center(middle);
    const double before_mm = in_mm.norm(), behind_mm = out_mm.norm();
    const Eigen::Vector3d in = in_mm / before_mm, out = out_mm / behind_mm;
    const Eigen::Vector3d bend = (out - in) / (before_mm + behind_mm);
    if (i < middle) return (in - before_mm * bend).normalized();
    return (i > middle ? out + behind_mm * bend : in + before_mm * bend).normalized();
  };
  Eigen::Vector3d e1 = along(0).unitOrthogonal();
  const auto carry_on = [&](std::ptrdiff_t i) {
    const Eigen::Vector3d axis = along(i);
    e1 = (e1 - e1.dot(axis) * axis).normalized();
    return axis;
  };
  for (std::ptrdiff_t i = 0; i < count; ++i) {
    const Eigen::Vector3d axis = carry_on(i);
    sections[static_cast<std::size_t>(i)].e1 = e1;
    sections[static_cast<std::size_t>(i)].e2 = axis.cross(e1);
  }
  if (!tube.closed) return sections;
  carry_on(0);
  const double turned_rad = std::atan2(e1.dot(sections[0].e2), e1.dot(sections[0].e1));
  for (std::size_t i = 0; i < sections.size(); ++i) {
    const double by_rad = -turned_rad * static_cast<double>(i) / static_cast<double>(count);
    const Eigen::Vector3d first = sections[i].e1, second = sections[i].e2;
    sections[i].e1 = std::cos(by_rad) * first + std::sin(by_rad) * second;
    sections[i].e2 = std::cos(by_rad) * second - std::sin(by_rad) * first;
  }
  return sections;
}

/// Corners of a circle as quarters of a rational curve of second degree: on it at every other one.
constexpr int kCorners = 9;

gp_Pnt corner_mm(const StepSection& section, int corner) {
  const double angle_rad = 0.25 * std::numbers::pi * corner;
  const double out_mm = section.radius_mm * (corner % 2 == 0 ? 1.0 : std::numbers::sqrt2);
  const Eigen::Vector3d p_mm =
      section.center_mm + out_mm * (std::cos(angle_rad) * section.e1 + std::sin(angle_rad) * section.e2);
  return {p_mm.x(), p_mm.y(), p_mm.z()};
}

/// The surface through the sections, each a true circle: the corners of all, interpolated along the line. A sweep by
/// OpenCASCADE does not get around every closed line, and has one radius.
opencascade::handle<Geom_BSplineSurface> surface_through(const std::vector<StepSection>& sections, bool closed) {
  const auto count = static_cast<int>(sections.size());
  const opencascade::handle<TColStd_HArray1OfReal> along = new TColStd_HArray1OfReal(1, closed ? count + 1 : count);
  for (int i = 1; i <= along->Length(); ++i) {
    const StepSection& now = sections[static_cast<std::size_t>((i - 1) % count)];
    const double way_mm = i == 1 ? 0.0 : (now.center_mm - sections[static_cast<std::size_t>(i - 2)].center_mm).norm();
    along->SetValue(i, i == 1 ? 0.0 : along->Value(i - 1) + way_mm);
  }
  std::vector<opencascade::handle<Geom_BSplineCurve>> lines;
  for (int corner = 0; corner < kCorners; ++corner) {
    const opencascade::handle<TColgp_HArray1OfPnt> points = new TColgp_HArray1OfPnt(1, count);
    for (int i = 0; i < count; ++i) points->SetValue(i + 1, corner_mm(sections[static_cast<std::size_t>(i)], corner));
    GeomAPI_Interpolate line(points, along, closed, 0.1 * kNothing_mm);
    line.Perform();
    lines.push_back(line.Curve());
  }
  const Geom_BSplineCurve& first = *lines.front();
  TColgp_Array2OfPnt poles(1, kCorners, 1, first.NbPoles());
  TColStd_Array2OfReal weights(1, kCorners, 1, first.NbPoles());
  for (int corner = 1; corner <= kCorners; ++corner) {
    for (int i = 1; i <= first.NbPoles(); ++i) {
      poles.SetValue(corner, i, lines[static_cast<std::size_t>(corner) - 1]->Pole(i));
      weights.SetValue(corner, i, corner % 2 == 1 ? 1.0 : 0.5 * std::numbers::sqrt2);
    }
  }
  TColStd_Array1OfReal around(1, 5);
  TColStd_Array1OfInteger times_around(1, 5);
  for (int i = 1; i <= 5; ++i) {
    around.SetValue(i, i - 1.0);
    times_around.SetValue(i, i == 1 || i == 5 ? 3 : 2);
  }
  return new Geom_BSplineSurface(poles, weights, around, first.Knots(), times_around, first.Multiplicities(), 2,
                                 first.Degree(), false, closed);
}

TopoDS_Face cap(const StepSection& section) {
  const gp_Pnt center(section.center_mm.x(), section.center_mm.y(), section.center_mm.z());
  return step_disc(gp_Ax2(center, direction(section.e1.cross(section.e2)), direction(section.e1)), section.radius_mm);
}

}  // namespace

gp_Dir direction(const Eigen::Vector3d& d) {
  return {d.x(), d.y(), d.z()};
}

TopoDS_Face step_disc(const gp_Ax2& axes, double radius_mm) {
  const TopoDS_Edge circle = BRepBuilderAPI_MakeEdge(gp_Circ(axes, radius_mm)).Edge();
  return BRepBuilderAPI_MakeFace(BRepBuilderAPI_MakeWire(circle).Wire()).Face();
}

TopoDS_Shape solid_through_nodes(const Tube& tube) {
  constexpr double kSewn_mm = 1e-4;
  const std::vector<StepSection> sections = sections_of(tube);
  if (sections.size() < 3) return {};
  const opencascade::handle<Geom_BSplineSurface> surface = surface_through(sections, tube.closed);
  double u1 = 0.0, u2 = 0.0, begin = 0.0, end = 0.0;
  surface->Bounds(u1, u2, begin, end);
  const double middle = 0.5 * (begin + end);
  BRepBuilderAPI_Sewing sewing(kSewn_mm);
  sewing.Add(BRepBuilderAPI_MakeFace(surface, u1, u2, begin, middle, kNothing_mm).Face());
  sewing.Add(BRepBuilderAPI_MakeFace(surface, u1, u2, middle, end, kNothing_mm).Face());
  if (!tube.closed) {
    sewing.Add(cap(sections.front()));
    sewing.Add(cap(sections.back()));
  }
  sewing.Perform();
  TopoDS_Solid solid = BRepBuilderAPI_MakeSolid(TopoDS::Shell(sewing.SewedShape())).Solid();
  BRepLib::OrientClosedSolid(solid);
  return solid;
}

}  // namespace tubetrack
