// No test is here: this program carries the headers that CMake compiles once for all tests (tests/CMakeLists.txt).
