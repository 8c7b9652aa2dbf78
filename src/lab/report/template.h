// The report's HTML, from one file: report.html, compiled in. It consists of blocks, each behind a
// line "<!--# NAME -->". Within a block, {{key}} stands for a text, which is escaped, and {{{key}}}
// for HTML, which is not. Thread-safe.
#pragma once

#include <initializer_list>
#include <string>
#include <utility>

namespace interneuron::report {

// The block of this name with its keys replaced. A block or a key that is not there is a bug of
// ours: std::logic_error, which names it.
using Values = std::initializer_list<std::pair<const char*, std::string>>;
std::string filled(const std::string& block, Values values);

}  // namespace interneuron::report
