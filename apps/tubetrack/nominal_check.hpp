#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "tubetrack/report/nominal.hpp"

namespace CLI {
class App;
}

namespace tubetrack {

/// --nominal and --tolerance as they were typed; empty: not given.
struct NominalFlags {
  std::string nominal, tolerance;
};
void add_nominal_flags(CLI::App& command, NominalFlags& flags);

/// What tubes are judged against: nothing where there are no nominal ones.
struct NominalCheck {
  std::vector<NominalTube> tubes;
  std::optional<double> tolerance_m;
};
/// Reads the nominal tubes, from a file that is not `out`, where results go; the error names flag or file, value and
/// fix.
Expected<NominalCheck> nominal_check_from(const NominalFlags& flags, const std::string& out);

/// How the tubes compare with the nominal ones, point by point, on stderr.
void print_nominal(std::span<const NominalComparison> comparisons);

/// An error where a nominal tube is not within the tolerance, if there is one. `name` is that of the scan or recording.
Expected<void> judge_nominal(const std::string& name, std::span<const NominalComparison> comparisons,
                             std::optional<double> tolerance_m);

}  // namespace tubetrack
