// SPDX-License-Identifier: Apache-2.0
// The rules of the house that a machine can read off the sources.
#include <gtest/gtest.h>

#include <algorithm>
#include <cctype>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <map>
#include <regex>
#include <set>
#include <sstream>

namespace {

namespace fs = std::filesystem;

const fs::path kSource = EGOSGM_SOURCE_DIR;

std::string text_of(const fs::path& file) {
  std::ifstream stream(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(stream), {}};
}

std::string without_comments(const std::string& text) {
  return std::regex_replace(text, std::regex(R"(//[^\n]*)"), "");
}

/// The project's own files with one of these endings, in its folders.
std::vector<fs::path> files(const std::set<std::string>& endings,
                            const std::vector<std::string>& folders = {"apps", "bench", "cmake", "host", "include",
                                                                       "kernels", "python", "scripts", "tests",
                                                                       "vision", "examples"}) {
  std::vector<fs::path> found;
  for (const std::string& folder : folders) {
    if (!fs::exists(kSource / folder)) continue;
    for (const auto& entry : fs::recursive_directory_iterator(kSource / folder)) {
      if (entry.is_regular_file() && endings.contains(entry.path().extension())) found.push_back(entry.path());
    }
  }
  std::sort(found.begin(), found.end());
  return found;
}

std::vector<fs::path> kernels() { return files({".cl"}, {"kernels"}); }
/// With the headers that they are made of.
std::vector<fs::path> kernel_texts() { return files({".cl", ".h"}, {"kernels"}); }

/// Bodies of the functions in a kernel file, by name.
std::vector<std::pair<std::string, std::string>> functions(const std::string& text) {
  std::vector<std::pair<std::string, std::string>> found;
  static const std::regex head(R"((\w+)\s*\([^(){};]*\)\s*\{)");
  for (std::sregex_iterator at(text.begin(), text.end(), head), end; at != end; ++at) {
    const std::string name = (*at)[1];
    if (name == "if" || name == "for" || name == "while" || name == "switch") continue;
    const std::size_t begin = at->position() + at->length();
    std::size_t stop = begin;
    for (int depth = 1; depth > 0 && stop < text.size(); ++stop)
      depth += text[stop] == '{' ? 1 : text[stop] == '}' ? -1 : 0;
    found.emplace_back(name, text.substr(begin, stop - begin));
  }
  return found;
}

TEST(House, EverySourceNamesItsLicence) {
  const auto sources = files({".h", ".cpp", ".cl", ".cmake", ".py"});
  ASSERT_GT(sources.size(), 50u);
  for (const fs::path& file : sources) {
    std::istringstream lines(text_of(file));
    std::string first, second;
    std::getline(lines, first), std::getline(lines, second);
    const std::string& line = first.starts_with("#!") ? second : first;
    EXPECT_TRUE(line.ends_with("SPDX-License-Identifier: Apache-2.0")) << file;
  }
}

TEST(House, PublicHeadersOfTheCoreNeedNeitherOpenClNorOpenCv) {
  const std::regex forbidden(R"(#\s*include\s*[<"](CL/|opencv2?|host/|kernels/))");
  for (const auto& entry : fs::directory_iterator(kSource / "include/egosgm")) {
    if (!entry.is_regular_file() || entry.path().filename() == "opencl.h") continue;
    EXPECT_FALSE(std::regex_search(text_of(entry.path()), forbidden)) << entry.path();
    EXPECT_EQ(text_of(entry.path()).find("egosgm/opencl.h\""), std::string::npos) << entry.path();
  }
}

TEST(House, PublicHeadersFitTwoScreens) {
  for (const fs::path& file : files({".h"}, {"include"})) {
    if (file.string().ends_with("_inline.h")) continue;  // definitions, which no user reads
    const std::string text = text_of(file);
    EXPECT_LE(std::count(text.begin(), text.end(), '\n'), 130) << file;
  }
}

TEST(House, WhatIsLinkedKnowsNothingOfOpenCv) {
  for (const fs::path& file : files({".h", ".cpp", ".cl"}, {"host", "kernels", "vision", "apps", "python"})) {
    EXPECT_EQ(text_of(file).find("<opencv2"), std::string::npos) << file;
    EXPECT_EQ(text_of(file).find("vision/opencv.h"), std::string::npos) << file;
  }
}

/// Folders below host/ whose files a folder's own files include, directly or by others.
std::map<fs::path, std::set<fs::path>> folders_included() {
  static const std::regex include("#include \"(host/[^\"]+)\"");
  std::map<fs::path, std::set<fs::path>> found;
  for (const fs::path& file : files({".h", ".cpp"}, {"host"})) {
    const fs::path folder = file.lexically_relative(kSource).parent_path();
    const std::string text = text_of(file);
    for (std::sregex_iterator at(text.begin(), text.end(), include), end; at != end; ++at) {
      const fs::path other = fs::path((*at)[1].str()).parent_path();
      if (other != folder) found[folder].insert(other);
    }
  }
  for (bool grew = true; grew;) {
    grew = false;
    for (auto& [folder, others] : found) {
      const std::size_t before = others.size();
      for (const fs::path& other : std::set<fs::path>(others)) others.insert(found[other].begin(), found[other].end());
      grew |= others.size() > before;
    }
  }
  return found;
}

TEST(House, NoFoldersOfHostIncludeEachOther) {
  const auto included = folders_included();
  ASSERT_GE(included.size(), 5u);
  for (const auto& [folder, others] : included) {
    EXPECT_FALSE(others.contains(folder)) << folder << " includes itself by way of others";
  }
}

std::string in_pascal_case(const std::string& name) {
  std::string result;
  for (std::size_t i = 0; i < name.size(); ++i) {
    const bool begins = i == 0 || name[i - 1] == '_';
    if (name[i] != '_')
      result += begins ? static_cast<char>(std::toupper(static_cast<unsigned char>(name[i]))) : name[i];
  }
  return result;
}

TEST(House, EveryKernelHasItsHostItsReferenceAndItsTest) {
  ASSERT_GE(kernels().size(), 10u);
  std::set<std::string> names;
  for (const fs::path& kernel : kernels()) {
    const std::string name = kernel.stem();
    EXPECT_TRUE(names.insert(name).second) << kernel << ": programs go by the names of their files";
    // A second way to a stage's bits, or its last part, shares its reference and its test, which runs all of them.
    const std::string stage = name == "banded_sgm_paths" || name == "read_off" ? "banded_sgm" : name;
    const std::string host = "host/stages/" + name, reference = "tests/reference/" + stage;
    for (const std::string& file :
         {host + ".h", host + ".cpp", reference + ".h", reference + ".cpp", "tests/stages/" + stage + "_test.cpp"}) {
      EXPECT_TRUE(fs::exists(kSource / file)) << file;
    }
    // scripts/check asks for tests by this name.
    const std::string tests = text_of(kSource / "tests/stages" / (stage + "_test.cpp"));
    EXPECT_TRUE(std::regex_search(tests, std::regex("TEST(_P)?\\(" + in_pascal_case(stage)))) << kernel;
  }
}

TEST(House, ReferencesShareNothingWithTheKernelsButTheirLayouts) {
  const std::regex foreign(R"(#\s*include\s*"(host/(?!method_options\.h)|CL/|kernels/method))");
  for (const fs::path& file : files({".h", ".cpp"}, {"tests/reference"})) {
    EXPECT_FALSE(std::regex_search(text_of(file), foreign)) << file;
  }
  for (const fs::path& file : files({".h", ".cpp"}, {"tests"})) {
    EXPECT_EQ(text_of(file).find("include \"kernels/method"), std::string::npos) << file;
  }
}

TEST(House, LinksOfTheDocumentationLeadSomewhere) {
  std::vector<fs::path> pages = files({".md"}, {"docs"});
  pages.push_back(kSource / "README.md");
  static const std::regex link(R"(\]\(([^)#]+)(#[^)]*)?\))");
  int links = 0;
  for (const fs::path& page : pages) {
    const std::string text = text_of(page);
    for (std::sregex_iterator at(text.begin(), text.end(), link), end; at != end; ++at) {
      const std::string target = (*at)[1];
      if (target.find("://") != std::string::npos) continue;
      ++links;
      EXPECT_TRUE(fs::exists(page.parent_path() / target)) << page << ": " << target;
    }
  }
  EXPECT_GT(links, 10);
}

TEST(House, NothingIsNamedAfterNothing) {
  const std::regex nothing(R"((^|_)(utils?|common|helpers?|managers?|base|misc)(_|$))");
  for (const fs::path& file : files({".h", ".cpp", ".cl", ".cmake", ".py"})) {
    EXPECT_FALSE(std::regex_search(file.stem().string(), nothing)) << file;
    EXPECT_FALSE(std::regex_search(file.parent_path().filename().string(), nothing)) << file;
  }
}

TEST(Kernels, UseOnlyWhatEveryDeviceHasAndRoundsAlike) {
  const std::pair<const char*, std::regex> rules[] = {
      {"64-bit atomics", std::regex(R"(\batom_\w+|cl_khr_int64)")},
      {"an extension", std::regex(R"(#pragma\s+OPENCL\s+EXTENSION)")},
      {"sub-groups", std::regex(R"(\bsub_group_)")},
      {"double", std::regex(R"(\bdouble\d*\b)")},
      {"a function that devices round differently",
       std::regex(
           R"(\b(native_\w+|half_(sqrt|recip|divide|exp|log)\w*|fma|mad|exp\d*|exp10|log\d*|pow\w?|sin|cos|tan|rsqrt|cbrt)\s*\()")},
      {"output", std::regex(R"(\bprintf\s*\()")},
      {"a function of C99's inline, which is nowhere where a compiler does not inline it",
       std::regex(R"((\n|[^c] )inline\b)")},
  };
  for (const fs::path& kernel : kernel_texts()) {
    const std::string text = without_comments(text_of(kernel));
    for (const auto& [what, rule] : rules) {
      std::smatch match;
      EXPECT_FALSE(std::regex_search(text, match, rule)) << kernel << " uses " << what << ": " << match.str();
    }
  }
}

TEST(Kernels, DoNotReturnBeforeABarrier) {
  for (const fs::path& kernel : kernel_texts()) {
    for (const auto& [name, body] : functions(without_comments(text_of(kernel)))) {
      const std::size_t last = body.rfind("barrier(");
      if (last == std::string::npos) continue;
      EXPECT_FALSE(std::regex_search(body.substr(0, last), std::regex(R"(\breturn\b)"))) << kernel << ": " << name;
    }
  }
}

// KERNEL (shared.h) tells compilers what not to make of them.
TEST(Kernels, BeginWithTheMacroThatSaysTheyAreVectors) {
  for (const fs::path& kernel : kernels()) {
    const std::string text = without_comments(text_of(kernel));
    EXPECT_FALSE(std::regex_search(text, std::regex(R"(\b(__)?kernel\b)"))) << kernel << ": KERNEL in place of kernel";
    EXPECT_TRUE(std::regex_search(text, std::regex(R"(\nKERNEL\b)"))) << kernel;
  }
}

TEST(Kernels, FitAScreenOrFive) {
  for (const fs::path& kernel : kernel_texts()) {
    const std::string text = text_of(kernel);
    EXPECT_LE(std::count(text.begin(), text.end(), '\n'), 350) << kernel;
    for (const auto& [name, body] : functions(without_comments(text))) {
      EXPECT_LE(std::count(body.begin(), body.end(), '\n'), 62) << kernel << ": " << name;
    }
  }
}

TEST(Kernels, DoNotRecur) {
  for (const fs::path& kernel : kernel_texts()) {
    for (const auto& [name, body] : functions(without_comments(text_of(kernel)))) {
      EXPECT_FALSE(std::regex_search(body, std::regex("\\b" + name + R"(\s*\()"))) << kernel << ": " << name;
    }
  }
}

TEST(Kernels, SayWhichDefinesTheyNeed) {
  for (const fs::path& kernel : kernels()) {
    const std::string text = without_comments(text_of(kernel));
    static const std::regex check(R"(#ifndef\s+(\w+)\s*\n\s*#error\s+"(\w+))");
    for (std::sregex_iterator at(text.begin(), text.end(), check), end; at != end; ++at) {
      const std::string name = (*at)[1];
      if (name.starts_with("__")) continue;
      EXPECT_EQ(name, (*at)[2].str()) << kernel << ": the error begins with the define's name";
    }
  }
}

}  // namespace
