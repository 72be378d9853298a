// SPDX-License-Identifier: Apache-2.0
#include "vision/frame_names.h"

#include <algorithm>
#include <charconv>
#include <cstdlib>
#include <map>
#include <set>
#include <system_error>
#include <utility>

#include "egosgm/error.h"

namespace egosgm::vision {
namespace {

namespace fs = std::filesystem;
using Kind = NamePattern::Kind;
using Files = std::map<std::string, fs::path>;  // text -> file

std::string without_zeros(const std::string& digits) {
  return digits.substr(std::min(digits.find_first_not_of('0'), digits.size() - 1));
}

/// The text between prefix and suffix; nothing where the name does not match. The number of a frame has no zeros
/// before it.
std::optional<std::string> text_in(const std::string& name, const NamePattern& pattern) {
  std::string suffix = pattern.suffix;
  if (pattern.below.empty() && suffix.find('.') == std::string::npos) {
    if (!is_image_name(name)) return std::nullopt;
    suffix += fs::path(name).extension().string();
  }
  if (name.size() < pattern.prefix.size() + suffix.size()) return std::nullopt;
  const std::size_t end = name.size() - suffix.size();
  if (!name.starts_with(pattern.prefix) || lower(name.substr(end)) != lower(suffix)) return std::nullopt;
  const std::string text = name.substr(pattern.prefix.size(), end - pattern.prefix.size());
  if (pattern.kind == Kind::kAnything) return parse_frame_number(text) ? without_zeros(text) : text;
  if (!is_digits(text)) return std::nullopt;
  const std::string number = without_zeros(text);
  if (!pattern.any_width && text != padded(number, pattern.digits)) return std::nullopt;
  return number;
}

Files find_files(const NamePattern& pattern) {
  if (pattern.kind == Kind::kPlain) return {{"0", pattern.folder / pattern.prefix}};
  Files files;
  for (const std::string& name : list_folder(pattern.folder)) {
    const std::optional<std::string> text = text_in(name, pattern);
    const fs::path file = pattern.below.empty() ? pattern.folder / name : pattern.folder / name / pattern.below;
    if (!text || is_folder(file) || (!pattern.below.empty() && !is_file(file))) continue;
    const auto [other, is_new] = files.emplace(*text, file);
    if (is_new) continue;
    throw InvalidArgument(other->second.string() + ": means the same frame as " + name +
                          "; remove one of them, or give a pattern that only one fits");
  }
  return files;
}

bool is_decimal(const std::string& text) {
  const std::size_t point = text.find('.');
  return is_digits(text.substr(0, point)) && (point == std::string::npos || is_digits(text.substr(point + 1)));
}

int compare_digits(const std::string& a, const std::string& b) {
  const std::string x = without_zeros(a), y = without_zeros(b);
  return x.size() != y.size() ? (x.size() < y.size() ? -1 : 1) : x.compare(y);
}

bool is_smaller_decimal(const std::string& a, const std::string& b) {
  const std::size_t in_a = a.find('.'), in_b = b.find('.');
  const int whole = compare_digits(a.substr(0, in_a), b.substr(0, in_b));
  if (whole != 0) return whole < 0;
  return a.substr(std::min(in_a, a.size())) < b.substr(std::min(in_b, b.size()));
}

std::vector<std::string> in_order(const std::set<std::string>& texts) {
  std::vector<std::string> sorted(texts.begin(), texts.end());
  const bool decimals = std::all_of(sorted.begin(), sorted.end(), is_decimal);
  std::sort(sorted.begin(), sorted.end(), decimals ? is_smaller_decimal : is_before);
  return sorted;
}

std::set<std::string> texts_of(const Files& files) {
  std::set<std::string> texts;
  for (const auto& [text, file] : files) texts.insert(text);
  return texts;
}

/// The texts themselves, if those of pairs are numbers, else their order. What only one camera has under another name,
/// as a mask, has no number then: it moves none.
void number(std::vector<NamedPair>& pairs) {
  const auto own = [](const NamedPair& pair) { return parse_frame_number(pair.text); };
  const bool numbers =
      std::any_of(pairs.begin(), pairs.end(), own) &&
      std::all_of(pairs.begin(), pairs.end(), [&](const NamedPair& pair) { return own(pair) || pair.is_alone(); });
  int position = 0;
  for (NamedPair& pair : pairs) pair.number = numbers ? own(pair).value_or(NamedPair::kNoNumber) : position++;
}

std::vector<NamedPair> pair_by_order(const Files& left, const Files& right) {
  if (left.size() != right.size()) {
    throw InvalidArgument("--pair-by order: there are " + std::to_string(left.size()) + " left and " +
                          std::to_string(right.size()) + " right images; give as many of both");
  }
  std::vector<NamedPair> pairs;
  for (const std::string& text : in_order(texts_of(left))) pairs.push_back({text, 0, left.at(text), {}});
  std::size_t i = 0;
  for (const std::string& text : in_order(texts_of(right))) pairs[i++].right = right.at(text);
  return pairs;
}

std::vector<NamedPair> pair_by_name(const Files& left, const Files& right) {
  std::set<std::string> texts = texts_of(left);
  texts.merge(texts_of(right));
  if (!left.empty() && !right.empty() && texts.size() == left.size() + right.size()) {
    throw InvalidArgument("no right image has the name of a left one: " + left.begin()->second.string() + " and " +
                          right.begin()->second.string() +
                          ", say; give patterns whose %d or * stands for equal texts, or --pair-by order");
  }
  std::vector<NamedPair> pairs;
  const auto file_in = [](const Files& files, const std::string& text) {
    const auto found = files.find(text);
    return found == files.end() ? fs::path() : found->second;
  };
  for (const std::string& text : in_order(texts)) {
    pairs.push_back({text, 0, file_in(left, text), file_in(right, text)});
  }
  return pairs;
}

std::string bound_text(const std::optional<int>& bound) { return bound ? std::to_string(*bound) : ""; }

/// Notes gaps in the numbers of frames that follow each other; empty without gaps.
std::string gap_note(const std::vector<StereoFrame>& frames) {
  std::size_t gaps = 0, first = 0;
  bool even = true;
  const auto step = [&](std::size_t i) { return frames[i].number - frames[i - 1].number; };
  for (std::size_t i = frames.size(); i-- > 1;) {
    even = even && step(i) == step(1);
    if (step(i) == 1) continue;
    ++gaps;
    first = i - 1;
  }
  if (gaps == 0) return {};
  const std::string all =
      "frame numbers " + std::to_string(frames.front().number) + ".." + std::to_string(frames.back().number);
  return all +
         (even && frames.size() > 2 ? " go in steps of " + std::to_string(step(1))
                                    : " have " + std::to_string(gaps) + (gaps == 1 ? " gap, " : " gaps, the first ") +
                                          "after " + std::to_string(frames[first].number)) +
         ": frames follow each other as they come, over a longer motion";
}

}  // namespace

bool is_before(const std::string& a, const std::string& b) {
  constexpr const char* kDigits = "0123456789";
  std::size_t i = 0, k = 0;
  while (i < a.size() && k < b.size()) {
    const std::string x = a.substr(i, std::min(a.find_first_not_of(kDigits, i), a.size()) - i);
    const std::string y = b.substr(k, std::min(b.find_first_not_of(kDigits, k), b.size()) - k);
    if (x.empty() || y.empty()) {
      if (a[i] != b[k]) return a[i] < b[k];
      ++i, ++k;
      continue;
    }
    if (const int order = compare_digits(x, y); order != 0) return order < 0;
    i += x.size(), k += y.size();
  }
  if ((i == a.size()) != (k == b.size())) return i == a.size();
  return a.size() != b.size() ? a.size() < b.size() : a < b;  // zeros before a number
}

bool is_digits(std::string_view text) {
  return !text.empty() && std::all_of(text.begin(), text.end(), [](char c) { return c >= '0' && c <= '9'; });
}

std::string lower(std::string text) {
  for (char& c : text) {
    if (c >= 'A' && c <= 'Z') c = static_cast<char>(c - 'A' + 'a');
  }
  return text;
}

std::optional<int> parse_frame_number(std::string_view text) {
  int number = 0;
  if (!is_digits(text)) return std::nullopt;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
  if (error != std::errc()) return std::nullopt;
  return number;
}

std::string padded(const std::string& digits, int width) {
  const auto wanted = static_cast<std::size_t>(width);
  return digits.size() < wanted ? std::string(wanted - digits.size(), '0') + digits : digits;
}

bool is_folder(const fs::path& path) {
  std::error_code error;
  return fs::is_directory(path, error);
}

bool is_file(const fs::path& path) {
  std::error_code error;
  return fs::is_regular_file(path, error);
}

bool is_image_name(const fs::path& name) {
  const std::string extension = lower(name.extension().string());
  return extension == ".png" || extension == ".jpg" || extension == ".jpeg";
}

std::vector<std::string> list_folder(const fs::path& folder) {
  std::error_code error;
  std::vector<std::string> names;
  fs::directory_iterator entry(folder, error);
  for (; !error && entry != fs::directory_iterator(); entry.increment(error)) {
    std::string name = entry->path().filename().string();
    if (!name.starts_with('.')) names.push_back(std::move(name));
  }
  if (error)
    throw InvalidArgument(folder.string() + ": cannot be listed: " + error.message() + "; give a readable folder");
  std::sort(names.begin(), names.end());
  return names;
}

fs::path NamePattern::file_of(const std::string& text) const {
  if (kind == Kind::kPlain) return folder / prefix;
  const std::string name = prefix + (kind == Kind::kNumber ? padded(text, digits) : text) + suffix;
  if (!below.empty()) return folder / name / below;
  return folder / (name + (suffix.find('.') == std::string::npos ? ".png" : ""));
}

/// `a/*/left.png`: the pattern of the folders, and the file that each of them holds; nothing of other patterns.
std::optional<NamePattern> parse_folder_pattern(const fs::path& path) {
  NamePattern parts;
  bool is_found = false;
  for (const fs::path& part : path) {
    const std::string name = part.string();
    const std::size_t at = name.find('*');
    if (is_found) {
      parts.below /= part;
    } else if (at == std::string::npos) {
      parts.folder /= part;
    } else {
      is_found = true;
      parts.prefix = name.substr(0, at), parts.suffix = name.substr(at + 1);
    }
  }
  parts.kind = Kind::kAnything;
  const bool is_one = (parts.suffix + parts.below.string()).find_first_of("*%") == std::string::npos;
  if (!is_found || !is_one || !parts.below.has_filename() || path.string().find('%') != std::string::npos) return {};
  if (parts.folder.empty()) parts.folder = ".";
  return parts;
}

NamePattern parse_pattern(const std::string& pattern) {
  const fs::path path(pattern);
  const std::string name = path.filename().string();
  const auto refuse = [&]() -> NamePattern {
    throw InvalidArgument("pattern '" + pattern +
                          "': its file name must hold one %d, %06d (or the like) or one *, or its folder one *");
  };
  NamePattern parts;
  parts.folder = path.has_parent_path() ? path.parent_path() : fs::path(".");
  const auto first_wild = [](const std::string& text) { return text.find_first_of("*%"); };
  const bool is_wild = first_wild(parts.folder.string()) != std::string::npos && !is_folder(parts.folder);
  if (is_wild) {
    if (const std::optional<NamePattern> of_folders = parse_folder_pattern(path)) return *of_folders;
  }
  if (name.empty() || is_wild) return refuse();
  const std::size_t begin = is_file(path) ? std::string::npos : first_wild(name);
  if (begin == std::string::npos) {
    parts.prefix = name;
    return parts;
  }
  std::size_t end = begin + 1;
  parts.kind = Kind::kAnything;
  if (name[begin] == '%') {
    const std::size_t width = end;
    while (end < name.size() && name[end] >= '0' && name[end] <= '9') ++end;
    if (end == name.size() || name[end] != 'd' || end - width > 3) return refuse();
    parts.kind = Kind::kNumber;
    if (end > width) {
      const int digits = std::atoi(name.substr(width, end - width).c_str());
      if (name[width] != '0' || digits < 1 || digits > 20) return refuse();
      parts.digits = digits;
    }
    ++end;
  }
  parts.prefix = name.substr(0, begin);
  parts.suffix = name.substr(end);
  if (parts.suffix.find_first_of("*%") != std::string::npos) return refuse();
  return parts;
}

std::vector<NamedPair> pair_files(const NamePattern& left, const NamePattern& right, PairBy pair_by) {
  const Files left_files = find_files(left), right_files = find_files(right);
  std::vector<NamedPair> pairs =
      pair_by == PairBy::kOrder ? pair_by_order(left_files, right_files) : pair_by_name(left_files, right_files);
  for (const NamedPair& pair : pairs) {
    if (pair.left == pair.right) {
      throw InvalidArgument(pair.left.string() + ": is the left and the right image; give one of each camera");
    }
  }
  number(pairs);
  return pairs;
}

std::string order_note(const std::vector<NamedPair>& pairs) {
  const auto number_of = [](const fs::path& file) {
    const std::string stem = file.stem().string();
    const std::size_t last = stem.find_last_not_of("0123456789");
    return parse_frame_number(stem.substr(last == std::string::npos ? 0 : last + 1));
  };
  std::optional<int> first_shift;
  for (const NamedPair& pair : pairs) {
    const std::optional<int> left = number_of(pair.left), right = number_of(pair.right);
    if (!left || !right) return {};
    if (!first_shift) first_shift = *right - *left;
    if (*right - *left == *first_shift) continue;
    return "paired by order, though the numbers in names go apart, first at " + pair.left.filename().string() +
           " and " + pair.right.filename().string() + ": is a frame missing on one side?";
  }
  return {};
}

std::vector<fs::path> files_in_order(const NamePattern& pattern) {
  const Files files = find_files(pattern);
  std::vector<fs::path> sorted;
  for (const std::string& text : in_order(texts_of(files))) sorted.push_back(files.at(text));
  return sorted;
}

void select_frames(const std::vector<NamedPair>& pairs, const NamePattern& left, FrameRange range,
                   const std::string& what, StereoSequence& sequence) {
  for (const NamedPair& pair : pairs) {
    if (pair.number != NamedPair::kNoNumber) sequence.numbers.push_back(pair.number);
  }
  const int lowest = sequence.numbers.front(), highest = sequence.numbers.back();
  const int first = range.first.value_or(lowest), last = range.last.value_or(highest);
  const std::string there = "there are frames " + std::to_string(lowest) + ".." + std::to_string(highest);
  const std::string remedy = "; " + there + ", select whole ones with --frames FIRST:LAST";
  if (first > last) {
    throw InvalidArgument(what + ": holds no frame in " + bound_text(range.first) + ":" + bound_text(range.last) +
                          remedy);
  }
  const auto refuse_missing = [&](int number) {
    throw InvalidArgument(left.file_of(std::to_string(number)).string() + ": frame " + std::to_string(number) +
                          " is missing" + remedy);
  };
  std::vector<std::string> alone;
  if (first < lowest) refuse_missing(first);
  if (last > highest) refuse_missing(last);
  for (const NamedPair& pair : pairs) {
    if (pair.number != NamedPair::kNoNumber && (pair.number < first || pair.number > last)) continue;
    if (pair.is_alone()) {
      alone.push_back(pair.left.empty() ? pair.right.string() : pair.left.string());
      continue;
    }
    StereoFrame frame;
    frame.number = pair.number;
    frame.name =
        parse_frame_number(pair.text) || !is_decimal(pair.text) ? padded(std::to_string(pair.number), 6) : pair.text;
    frame.left = pair.left;
    frame.right = pair.right;
    sequence.frames.push_back(std::move(frame));
  }
  if (alone.size() > sequence.frames.size()) {
    throw InvalidArgument(alone.front() + ": has no partner" + (sequence.frames.empty() ? "" : ", as most have none") +
                          remedy + ", or other patterns");
  }
  if (sequence.frames.empty()) refuse_missing(first);
  sequence.note = gap_note(sequence.frames);
  if (alone.empty()) return;
  sequence.note += (sequence.note.empty() ? "" : "; ") + std::to_string(alone.size()) +
                   (alone.size() == 1 ? " image" : " images") + " without the other camera's left out, the first is " +
                   alone.front();
}

}  // namespace egosgm::vision
