#include "tubetrack/report/step_file.hpp"

#include <fmt/format.h>

#include <APIHeaderSection_MakeHeader.hxx>
#include <BRepBuilderAPI_MakeEdge.hxx>
#include <BRepBuilderAPI_MakeWire.hxx>
#include <BRepCheck_Analyzer.hxx>
#include <BRepGProp.hxx>
#include <BRepOffsetAPI_MakePipe.hxx>
#include <BRepPrimAPI_MakeTorus.hxx>
#include <Eigen/Geometry>
#include <GProp_GProps.hxx>
#include <Interface_Static.hxx>
#include <Message.hxx>
#include <Message_Messenger.hxx>
#include <STEPControl_Writer.hxx>
#include <Standard_Failure.hxx>
#include <StepBasic_Product.hxx>
#include <StepData_StepModel.hxx>
#include <TCollection_HAsciiString.hxx>
#include <TopoDS_Shape.hxx>
#include <algorithm>
#include <cmath>
#include <exception>
#include <gp_Ax2.hxx>
#include <gp_Circ.hxx>
#include <gp_Pnt.hxx>
#include <numbers>
#include <optional>

#include "step_surface.hpp"
#include "tubetrack/tracker/bend_table.hpp"
#include "tubetrack/tracker/part_chain.hpp"

namespace tubetrack {

namespace {

gp_Pnt point_mm(const Eigen::Vector3d& p_m) {
  return {kMillimetres * p_m.x(), kMillimetres * p_m.y(), kMillimetres * p_m.z()};
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
  return BRepOffsetAPI_MakePipe(wire.Wire(),
                                step_disc(gp_Ax2(point_mm(chain.start_m), direction(chain.direction)), radius_mm))
      .Shape();
}

TopoDS_Shape torus_of(const PartChain& ring, double radius_mm) {
  const PlacedBend bend = place(ring).bends.front();
  return BRepPrimAPI_MakeTorus(gp_Ax2(point_mm(bend.center_m), direction(bend.axis)), kMillimetres * bend.radius_m,
                               radius_mm)
      .Shape();
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
    TopoDS_Shape parts = !of_parts ? TopoDS_Shape()
                         : ring    ? torus_of(*chain, radius_mm)
                                   : solid_of_chain(*chain, radius_mm);
    if (is_sound(parts, expected_mm3)) return parts;
    TopoDS_Shape shape = solid_through_nodes(tube);
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
