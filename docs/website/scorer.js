/** Rank what a search of the site finds: Sphinx gives 15 to a title and 5 to a text, however often it has the words.
 * Plugins whose summary has all words of the query come before other texts; and pages on which one question has several
 * words, before titles, which have one of them. */
const wordsOf = (text) => text.toLowerCase().match(/[\p{L}\p{N}_]+/gu) ?? [];

var Scorer = {
  score([page, , , , score, , kind]) {
    const asked = wordsOf(new URLSearchParams(location.search).get("q"));
    const hasAll = (text) => asked.length && asked.every((word) => wordsOf(text).some((it) => it.startsWith(word)));
    if (kind !== "text") return score;
    if (asked.length > 1 && QUESTIONS[page]?.some(hasAll)) return score + 11;
    return hasAll(SUMMARIES[page] ?? "") ? score + 9 : score;
  },
  title: 15,
  partialTitle: 7,
  term: 5,
  partialTerm: 2,
};
