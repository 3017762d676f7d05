#include "tubetrack/report/step_file.hpp"

#include <fmt/format.h>

#include <APIHeaderSection_MakeHeader.hxx>
#include <BRepBuilderAPI_MakeEdge.hxx>
#include <BRepBuilderAPI_MakeFace.hxx>
#include <BRepBuilderAPI_MakeSolid.hxx>
#include <BRepBuilderAPI_MakeWire.hxx>
#include <BRepBuilderAPI_Sewing.hxx>
#include <BRepCheck_Analyzer.hxx>
#include <BRepGProp.hxx>
#include <BRepLib.hxx>
#include <BRepOffsetAPI_MakePipe.hxx>
#include <BRepPrimAPI_MakeTorus.hxx>
#include <Eigen/Geometry>
#include <GProp_GProps.hxx>
#include <GeomAPI_Interpolate.hxx>
#include <Geom_BSplineCurve.hxx>
#include <Geom_BSplineSurface.hxx>
#include <Interface_Static.hxx>
#include <Message.hxx>
#include <Message_Messenger.hxx>
#include <STEPControl_Writer.hxx>
#include <Standard_Failure.hxx>
#include <StepBasic_Product.hxx>
#include <StepData_StepModel.hxx>
#include <TColStd_Array1OfInteger.hxx>
#include <TColStd_Array1OfReal.hxx>
#include <TColStd_Array2OfReal.hxx>
#include <TColStd_HArray1OfReal.hxx>
#include <TColgp_Array2OfPnt.hxx>
#include <TColgp_HArray1OfPnt.hxx>
#include <TCollection_HAsciiString.hxx>
#include <TopoDS.hxx>
#include <TopoDS_Edge.hxx>
#include <TopoDS_Face.hxx>
#include <TopoDS_Shape.hxx>
#include <TopoDS_Shell.hxx>
#include <TopoDS_Solid.hxx>
#include <TopoDS_Wire.hxx>
#include <algorithm>
#include <cmath>
#include <exception>
#include <gp_Ax2.hxx>
#include <gp_Circ.hxx>
#include <gp_Dir.hxx>
#include <gp_Pnt.hxx>
#include <numbers>
#include <optional>

#include "tubetrack/tracker/bend_table.hpp"
#include "tubetrack/tracker/part_chain.hpp"

namespace tubetrack {

namespace {

constexpr double kMillimetres = 1e3;  // what CAD programs expect; their tolerance of 1e-7 is of such units
// Shorter parts are none: points that near are the same to a CAD program.
constexpr double kNothing_mm = 1e-5;

gp_Pnt point_mm(const Eigen::Vector3d& p_m) {
  return {kMillimetres * p_m.x(), kMillimetres * p_m.y(), kMillimetres * p_m.z()};
}

gp_Dir direction(const Eigen::Vector3d& d) {
  return {d.x(), d.y(), d.z()};
}

/// The tube's section at the start of its centreline.
TopoDS_Face disc(const gp_Pnt& center, const gp_Dir& along, double radius_mm) {
  const TopoDS_Edge circle = BRepBuilderAPI_MakeEdge(gp_Circ(gp_Ax2(center, along), radius_mm)).Edge();
  return BRepBuilderAPI_MakeFace(BRepBuilderAPI_MakeWire(circle).Wire()).Face();
}

/// Swept along lines and circles a circle makes cylinders and tori, not splines that look like them.
TopoDS_Shape solid_of_chain(const PartChain& chain, double radius_mm) {
  const PlacedChain placed = place(chain);
  BRepBuilderAPI_MakeWire wire;
  const auto add_straight = [&](const Eigen::Vector3d& from_m, const Eigen::Vector3d& tangent, double length_m) {
    if (kMillimetres * length_m > kNothing_mm)
      wire.Add(BRepBuilderAPI_MakeEdge(point_mm(from_m), point_mm(from_m + length_m * tangent)).Edge());
  };
  for (std::size_t i = 0; i < chain.bends.size(); ++i) {
    const PlacedBend& bend = placed.bends[i];
    add_straight(bend.straight_start_m, bend.tangent, chain.bends[i].straight_m);
    const gp_Ax2 axes(point_mm(bend.center_m), direction(bend.axis), direction(-bend.towards));
    wire.Add(
        BRepBuilderAPI_MakeEdge(gp_Circ(axes, kMillimetres * bend.radius_m), 0.0, chain.bends[i].angle_rad).Edge());
  }
  add_straight(placed.last_start_m, placed.last_tangent, chain.closing_m);
  return BRepOffsetAPI_MakePipe(wire.Wire(), disc(point_mm(chain.start_m), direction(chain.direction), radius_mm))
      .Shape();
}

TopoDS_Shape torus_of(const PartChain& ring, double radius_mm) {
  const PlacedBend bend = place(ring).bends.front();
  return BRepPrimAPI_MakeTorus(gp_Ax2(point_mm(bend.center_m), direction(bend.axis)), kMillimetres * bend.radius_m,
                               radius_mm)
      .Shape();
}

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
  const gp_Ax2 axes(center, direction(section.e1.cross(section.e2)), direction(section.e1));
  const TopoDS_Edge circle = BRepBuilderAPI_MakeEdge(gp_Circ(axes, section.radius_mm)).Edge();
  return BRepBuilderAPI_MakeFace(BRepBuilderAPI_MakeWire(circle).Wire()).Face();
}

/// Two halves of its length, a closed one's sewn together at both ends, an open one's with caps there.
TopoDS_Shape solid_of_nodes(const Tube& tube) {
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

/// Of circles whose centres go along the line: area times way (Pappus).
double volume_mm3(const Tube& tube) {
  double sum_mm3 = 0.0;
  for (std::size_t i = 1; i < tube.centerline_m.size(); ++i) {
    double squared_m2 = tube.radius_m * tube.radius_m;
    if (!tube.node_radius_m.empty()) {
      const double a_m = tube.node_radius_m[i - 1], b_m = tube.node_radius_m[i];
      squared_m2 = (a_m * a_m + a_m * b_m + b_m * b_m) / 3.0;
    }
    sum_mm3 += squared_m2 * (tube.centerline_m[i] - tube.centerline_m[i - 1]).norm();
  }
  return std::numbers::pi * kMillimetres * kMillimetres * kMillimetres * sum_mm3;
}

/// Closed, and as large as it should be.
bool is_sound(const TopoDS_Shape& shape, double expected_mm3) {
  constexpr double kSameVolume = 0.01;
  if (shape.IsNull() || shape.ShapeType() != TopAbs_SOLID || !BRepCheck_Analyzer(shape).IsValid()) return false;
  GProp_GProps properties;
  BRepGProp::VolumeProperties(shape, properties);
  return std::abs(properties.Mass() - expected_mm3) <= kSameVolume * expected_mm3;
}

/// A bend is tighter than the tube is thick: its surface would pass through itself, which OpenCASCADE does not see.
bool is_folded(const Tube& tube, const std::optional<PartChain>& chain) {
  if (chain) {
    return std::any_of(chain->bends.begin(), chain->bends.end(),
                       [&](const ChainBend& bend) { return bend.radius_m < tube.radius_m; });
  }
  for (std::size_t i = 2; i < tube.centerline_m.size(); ++i) {
    const Eigen::Vector3d in_m = tube.centerline_m[i - 1] - tube.centerline_m[i - 2];
    const Eigen::Vector3d out_m = tube.centerline_m[i] - tube.centerline_m[i - 1];
    // The circle through three points has the radius |a||b||a + b| / 2|a × b|.
    if (in_m.norm() * out_m.norm() * (in_m + out_m).norm() < 2.0 * tube.radius_m * in_m.cross(out_m).norm())
      return true;
  }
  return false;
}

/// The solid, or nothing. `note` says what it is not.
std::optional<TopoDS_Shape> solid_of(const Tube& tube, std::string& note) {
  const std::optional<PartChain> chain = chain_of(tube.bend_table);
  const bool ring = tube.closed && chain && chain->bends.size() == 1 &&
                    std::abs(chain->bends.front().angle_rad - 2.0 * std::numbers::pi) < 1e-5;
  const double radius_mm = kMillimetres * tube.radius_m;
  note.clear();
  if (is_folded(tube, chain)) {
    note = fmt::format("tube {}: is left out: it has a bend tighter than it is thick", tube.id);
    return std::nullopt;
  }
  try {
    // A chain that is not as long as the line is not the tube: one called straight may bend.
    const double expected_mm3 = volume_mm3(tube);
    const bool of_parts = ring || (chain && !tube.closed && tube.node_radius_m.empty());
    const TopoDS_Shape parts = !of_parts ? TopoDS_Shape()
                               : ring    ? torus_of(*chain, radius_mm)
                                         : solid_of_chain(*chain, radius_mm);
    if (is_sound(parts, expected_mm3)) return parts;
    const TopoDS_Shape shape = solid_of_nodes(tube);
    note = fmt::format("tube {}: not all straight and toric: a spline surface through its nodes' sections, {}", tube.id,
                       tube.node_radius_m.empty() ? fmt::format("{:.3f} mm thick throughout", 2.0 * radius_mm)
                                                  : "as thick as they are");
    if (is_sound(shape, expected_mm3)) return shape;
    note = fmt::format("tube {}: is left out: its section, swept along it, makes no valid solid", tube.id);
  } catch (const Standard_Failure& failure) {
    note = fmt::format("tube {}: is left out: OpenCASCADE makes no solid of it ({})", tube.id,
                       failure.DynamicType()->Name());
  }
  return std::nullopt;
}

/// OpenCASCADE tells what it does on standard output, where results go.
class SilentOpenCascade {
 public:
  SilentOpenCascade() : printers_(Message::DefaultMessenger()->Printers()) {
    Message::DefaultMessenger()->ChangePrinters().Clear();
  }
  ~SilentOpenCascade() { Message::DefaultMessenger()->ChangePrinters() = printers_; }
  SilentOpenCascade(const SilentOpenCascade&) = delete;
  SilentOpenCascade& operator=(const SilentOpenCascade&) = delete;

 private:
  Message_SequenceOfPrinters printers_;
};

/// OpenCASCADE numbers the products itself.
void name_products(STEPControl_Writer& writer, const std::vector<std::string>& names) {
  const opencascade::handle<StepData_StepModel> model = writer.Model();
  auto name = names.begin();
  for (int i = 1; i <= model->NbEntities() && name != names.end(); ++i) {
    const auto product = opencascade::handle<StepBasic_Product>::DownCast(model->Value(i));
    if (product.IsNull()) continue;
    product->SetId(new TCollection_HAsciiString(name->c_str()));
    product->SetName(new TCollection_HAsciiString(name->c_str()));
    ++name;
  }
}

void set_header(STEPControl_Writer& writer) {
  APIHeaderSection_MakeHeader header(writer.Model());
  const auto text = [](const char* value) { return new TCollection_HAsciiString(value); };
  header.SetName(text("tubes"));
  header.SetTimeStamp(text("1970-01-01T00:00:00"));
  header.SetAuthorValue(1, text(""));
  header.SetOrganizationValue(1, text(""));
  header.SetOriginatingSystem(text("tubetrack"));
  header.SetAuthorisation(text(""));
  header.SetDescriptionValue(1, text("tubes found in a scan"));
}

}  // namespace

Expected<std::vector<std::string>> write_step(const std::filesystem::path& path, std::span<const Tube> tubes) {
  const auto failed = [&](std::string_view why) {
    return tl::make_unexpected(Error::failed(fmt::format("{}: {}", path.string(), why)));
  };
  std::vector<std::string> notes;
  std::vector<std::string> names;
  const SilentOpenCascade silent;
  try {
    STEPControl_Writer writer;
    Interface_Static::SetCVal("write.step.unit", "MM");
    for (const Tube& tube : tubes) {
      std::string note;
      const std::optional<TopoDS_Shape> solid = solid_of(tube, note);
      if (!note.empty()) notes.push_back(note);
      if (!solid) continue;
      if (writer.Transfer(*solid, STEPControl_ManifoldSolidBrep) != IFSelect_RetDone)
        return failed(fmt::format("tube {}: can't be put into STEP", tube.id));
      names.push_back(fmt::format("tube {}", tube.id));
    }
    if (names.empty())
      return failed(notes.empty() ? "there is no tube to write" : fmt::format("nothing to write: {}", notes.front()));
    name_products(writer, names);
    set_header(writer);
    if (writer.Write(path.c_str()) != IFSelect_RetDone)
      return failed("can't be written; give a file in an existing folder, on a disk that has room");
  } catch (const Standard_Failure& failure) {
    return failed(failure.GetMessageString());
  } catch (const std::exception& problem) {
    return failed(problem.what());
  }
  return notes;
}

}  // namespace tubetrack
