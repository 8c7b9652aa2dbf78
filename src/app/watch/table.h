// The links as text: the tables of `interneuron links`. Pure.
#pragma once

#include <string>
#include <vector>

#include "app/watch/row.h"

namespace interneuron::cli {

// Two tables, what the kernel says and what was measured, and a line for each reason why a NIC is
// not used.
std::string links_table(const LinksSnapshot& snapshot);

// Cells of the tables, also of `top`. "–" for what was not measured.
std::string ms_text(Duration d);         // "18.4", "0.38", "173"
std::string mbit_text(DataRate rate);    // "48.2", "120", "0.3"
std::string percent_text(double share);  // "0.0", "1.3", "100"
std::string age_text(Duration age);      // "0.2s", "14s", "3m"
inline constexpr const char* kNothing = "–";

// Columns that a terminal needs for UTF-8 text without wide or combining characters.
std::size_t columns(std::string_view text);
// Padded with blanks to `width` columns, or cut with "…".
std::string fitted(const std::string& text, std::size_t width, bool right = false);

// Of what a NIC is reached at, the address for people: the first that is not link-local, else the
// first; with how many there are besides, "10.0.0.2 +1".
std::string address_text(const std::vector<Address>& addresses);

}  // namespace interneuron::cli
