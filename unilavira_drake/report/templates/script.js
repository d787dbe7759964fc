"use strict";
// One page at a time, named by the address: #overview, #step=7. Without this script all are shown.
(() => {
  const pages = [...document.querySelectorAll(".page")];
  const links = [...document.querySelectorAll(".timeline a")];
  const timeline = document.querySelector(".timeline details");
  const narrow = window.matchMedia("(max-width: 900px)");

  const index = () => {
    const id = decodeURIComponent(location.hash.slice(1));
    return Math.max(0, pages.findIndex((page) => page.id === id));
  };

  const show = (moved) => {
    const current = index();
    pages.forEach((page, i) => { page.hidden = i !== current; });
    links.forEach((link, i) => {
      if (i === current) link.setAttribute("aria-current", "page");
      else link.removeAttribute("aria-current");
    });
    document.body.classList.toggle("stepping", current > 0);
    if (narrow.matches) timeline.open = false;
    const list = timeline.querySelector("ol");
    const link = links[current];
    list.scrollTop = link.offsetTop - list.offsetTop - list.clientHeight / 2;
    if (moved) {
      pages[current].querySelector("h2").focus({ preventScroll: true });
      window.scrollTo(0, 0);
    }
  };

  document.documentElement.classList.add("scripted");
  window.addEventListener("hashchange", () => show(true));
  document.addEventListener("keydown", (event) => {
    if (event.altKey || event.ctrlKey || event.metaKey || event.shiftKey) return;
    const step = { ArrowLeft: -1, ArrowRight: 1 }[event.key];
    const next = pages[index() + (step || 0)];
    if (!step || !next) return;
    event.preventDefault();
    location.hash = next.id;
  });
  show(location.hash.length > 1);
})();
