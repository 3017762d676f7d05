#include "nominal_check.hpp"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <filesystem>
#include <system_error>
#include <utility>

#include "flag_values.hpp"

namespace tubetrack {

void add_nominal_flags(CLI::App& command, NominalFlags& flags) {
  command
      .add_option("--nominal", flags.nominal,
                  "what a bent tube should be: XYZ points as `tubetrack scan --xyz` writes them; prints the deviations")
      ->type_name("FILE.csv");
  command
      .add_option("--tolerance", flags.tolerance,
                  "with --nominal: in millimetres; the exit code is 1 where a tube is out of it")
      ->type_name("MM");
}

Expected<NominalCheck> nominal_check_from(const NominalFlags& flags, const std::string& out) {
  NominalCheck check;
  if (!flags.tolerance.empty()) {
    const auto tolerance_mm = number_from<double>(flags.tolerance);
    if (!tolerance_mm || *tolerance_mm <= 0.0)
      return malformed("--tolerance", flags.tolerance, "millimetres, above 0, like 0.5");
    check.tolerance_m = 1e-3 * *tolerance_mm;
    if (flags.nominal.empty()) return tl::make_unexpected(Error::usage("--tolerance: give --nominal FILE.csv as well"));
  }
  if (flags.nominal.empty()) return check;
  std::error_code ignored;
  if (std::filesystem::equivalent(flags.nominal, out, ignored))
    return tl::make_unexpected(Error::usage(fmt::format("--out {}: is the --nominal file; give another name", out)));
  auto tubes = read_nominal_csv(flags.nominal);
  if (!tubes) return tl::make_unexpected(tubes.error());
  check.tubes = std::move(*tubes);
  return check;
}

void print_nominal(std::span<const NominalComparison> comparisons) {
  for (const NominalComparison& comparison : comparisons) {
    if (!comparison.problem.empty()) {
      fmt::print(stderr, "nominal tube {}: {}\n", comparison.nominal, comparison.problem);
      continue;
    }
    fmt::print(stderr, "nominal tube {} on tube {}{}: RMS {:.3f} mm, sheath at most {:.3f} mm\n", comparison.nominal,
               comparison.tube, comparison.reversed ? " (from its other end)" : "", 1e3 * comparison.rms_m,
               1e3 * comparison.max_sheath_m);
    fmt::print(stderr, "  {:>5}  {:<11}  {:>12}  {:>9}\n", "point", "", "deviation mm", "sheath mm");
    for (const NominalPoint& point : comparison.points) {
      fmt::print(stderr, "  {:>5}  {:<11}  {:>12.3f}  {:>9.3f}\n", point.point, nominal_point_name(point.at),
                 1e3 * point.deviation_m, 1e3 * point.sheath_m);
    }
  }
}

Expected<void> judge_nominal(const std::string& name, std::span<const NominalComparison> comparisons,
                             std::optional<double> tolerance_m) {
  if (!tolerance_m) return {};
  for (const NominalComparison& comparison : comparisons) {
    if (comparison.within(*tolerance_m)) continue;
    return tl::make_unexpected(Error::failed(
        comparison.problem.empty()
            ? fmt::format("{}: nominal tube {} is out of tolerance: deviates by {:.3f} mm, sheath by {:.3f} mm; "
                          "--tolerance {:g} mm",
                          name, comparison.nominal, 1e3 * comparison.max_deviation_m, 1e3 * comparison.max_sheath_m,
                          1e3 * *tolerance_m)
            : fmt::format("{}: nominal tube {} can't be compared: {}", name, comparison.nominal, comparison.problem)));
  }
  return {};
}

}  // namespace tubetrack
