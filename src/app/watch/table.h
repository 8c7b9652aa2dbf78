// The links as text: the tables of `interneuron links`, and the cells and small pictures of `top`.
// Pure; thread-safe; no errors.
#pragma once

#include <deque>
#include <string>
#include <vector>

#include "app/watch/row.h"

namespace interneuron::watch {

// Two tables, one of what the kernel says and one of what was measured, and a line for each NIC
// that is not used with the reason.
std::string links_table(const LinksSnapshot& snapshot);

// Cells of the tables, also of `top`; kNothing for what was not measured.
// "18.4", "0.38", "173".
std::string ms_text(Duration d);
// "48.2", "120", "0.3".
std::string mbit_text(DataRate rate);
// "0.0", "1.3", "100".
std::string percent_text(double share);
// "0.2s", "14s", "3m".
std::string age_text(Duration age);
inline constexpr const char* kNothing = "–";

// The columns that UTF-8 text without wide or combining characters takes on a terminal.
std::size_t columns(std::string_view text);
// The text padded with blanks to `width` columns, on the left if `right`, or cut with "…".
std::string fitted(const std::string& text, std::size_t width, bool right = false);

// Small pictures made of characters, for `interneuron top`.
// One character for each of the newest `width` values, with `top` as the full height. A negative
// value was not measured and becomes a blank; with fewer values than `width` there are blanks on
// the left.
std::string sparkline(const std::deque<double>& values, double top, std::size_t width,
                      bool unicode);
// A bar of `share` in [0, 1].
std::string bar(double share, std::size_t width, bool unicode);

// UTF-8 text as ASCII with the same number of columns.
std::string ascii(const std::string& text);

// One of a NIC's addresses, for people: the first that is not link-local, else the first; with the
// number of the others, "10.0.0.2 +1".
std::string address_text(const std::vector<Address>& addresses);

}  // namespace interneuron::watch
