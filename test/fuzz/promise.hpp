// What holds whatever the bytes are. A broken promise fails a test of gtest, and ends a fuzzer.
#pragma once

#include <stdexcept>

// Throws std::logic_error, which no refusal is.
inline void promise(bool kept, const char* what) {
  if (!kept) throw std::logic_error(what);
}
