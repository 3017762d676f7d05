#include "tubetrack/report/scan_json.hpp"

#include <cmath>
#include <nlohmann/json.hpp>

#include "tubetrack/report/result_json.hpp"

namespace tubetrack {

namespace {

using Json = nlohmann::ordered_json;

/// To a micrometre, without −0, as result_line does.
double micro(double value) {
  return std::round(value * 1e6) / 1e6 + 0.0;
}

Json joint_json(const TubeJoint& joint) {
  const Eigen::Vector3d& p = joint.position_m;
  Json json{{"position_m", {micro(p.x()), micro(p.y()), micro(p.z())}}, {"tubes", Json::array()}};
  for (const TubeJoint::Part& part : joint.parts)
    json["tubes"].push_back({{"id", part.tube}, {"at", joint_part_name(part.at)}, {"along_m", micro(part.along_m)}});
  return json;
}

Json nominal_json(const NominalComparison& comparison, std::optional<double> tolerance_m) {
  Json json{{"nominal", comparison.nominal}};
  if (comparison.problem.empty()) {
    json["tube"] = comparison.tube;
    json["reversed"] = comparison.reversed;
    json["rms_m"] = micro(comparison.rms_m);
    json["max_deviation_m"] = micro(comparison.max_deviation_m);
    json["max_sheath_m"] = micro(comparison.max_sheath_m);
    json["points"] = Json::array();
    for (const NominalPoint& point : comparison.points) {
      json["points"].push_back({{"at", nominal_point_name(point.at)},
                                {"point", point.point},
                                {"deviation_m", micro(point.deviation_m)},
                                {"sheath_m", micro(point.sheath_m)}});
    }
  } else {
    json["error"] = comparison.problem;
  }
  if (tolerance_m) {
    json["tolerance_m"] = *tolerance_m;
    json["pass"] = comparison.within(*tolerance_m);
  }
  return json;
}

}  // namespace

std::string scan_result_line(const TubeFrame& frame, bool with_timing, const ScanFindings& findings) {
  Json more = Json::object();
  for (const TubeJoint& joint : findings.joints) more["joints"].push_back(joint_json(joint));
  for (const NominalComparison& comparison : findings.nominal)
    more["nominal"].push_back(nominal_json(comparison, findings.tolerance_m));
  std::string line = result_line(frame, with_timing);
  if (more.empty()) return line;
  // Both are objects: the second's keys go behind the first's.
  line.back() = ',';
  return line + more.dump().substr(1);
}

std::string_view joint_part_name(TubeJoint::At at) {
  switch (at) {
    case TubeJoint::At::start:
      return "start";
    case TubeJoint::At::end:
      return "end";
    default:
      return "flank";
  }
}

}  // namespace tubetrack
