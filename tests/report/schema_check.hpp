#pragma once

#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

namespace tubetrack::test {

/// Holds every line against docs/output.schema.json with python3-jsonschema; returns what it complains about, empty for
/// nothing. Works in `folder`.
inline std::string schema_complaints(const std::vector<std::string>& lines, const std::filesystem::path& folder) {
  const auto script = folder / "check.py", input = folder / "lines.jsonl", output = folder / "complaints.txt";
  std::ofstream(script) << R"(import json, sys
try:
    import jsonschema
except ImportError:
    sys.exit("python3-jsonschema is not installed")
schema = json.load(open(sys.argv[1], encoding="utf-8"))
jsonschema.Draft202012Validator.check_schema(schema)
validator = jsonschema.Draft202012Validator(schema)
lines = [line for line in open(sys.argv[2], encoding="utf-8") if line.strip()]
for number, line in enumerate(lines, 1):
    for error in validator.iter_errors(json.loads(line)):
        print(f"line {number}: {error.json_path}: {error.message}")
print(f"{len(lines)} lines looked at")
)";
  std::ofstream(input) << [&] {
    std::string text;
    for (const std::string& line : lines) text += line + "\n";
    return text;
  }();
  const std::string command = "python3 '" + script.string() + "' '" TUBETRACK_SOURCE_DIR "/docs/output.schema.json' '" +
                              input.string() + "' > '" + output.string() + "' 2>&1";
  const int status = std::system(command.c_str());
  std::ifstream file(output);
  std::string text{std::istreambuf_iterator<char>(file), {}};
  const std::string looked_at = std::to_string(lines.size()) + " lines looked at\n";
  return status == 0 && text == looked_at ? "" : text;
}

}  // namespace tubetrack::test
