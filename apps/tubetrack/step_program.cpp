// tubetrack_step FILE.step: writes the tubes of a result (one line of JSON, on standard input) as STEP. `tubetrack scan
// --step` starts it; by hand it takes a line of any run: tail -n 1 tubes.jsonl | tubetrack_step tubes.step
// On standard output: "note: …" for what is not as it is in the result, and at last "written", or why it is not.
#include <fmt/format.h>

#include <iostream>
#include <string>

#include "tubetrack/report/result_json.hpp"
#include "tubetrack/report/step_file.hpp"

int main(int argc, char** argv) {
  std::string line;
  if (argc != 2 || !std::getline(std::cin, line)) {
    fmt::print(stderr, "usage: tail -n 1 RESULT.jsonl | tubetrack_step FILE.step\n");
    return 2;
  }
  const auto frame = tubetrack::parse_result_line(line);
  if (!frame) {
    fmt::print("{}\n", frame.error().message);
    return 1;
  }
  const auto notes = tubetrack::write_step(argv[1], frame->tubes);
  if (!notes) {
    fmt::print("{}\n", notes.error().message);
    return 1;
  }
  for (const std::string& note : *notes) fmt::print("note: {}\n", note);
  fmt::print("written\n");
  return 0;
}
