
'use strict';
{
  const root = document.documentElement;
  // Whoever tests the page reads what went wrong.
  const failed = e => { root.dataset.errors = `${root.dataset.errors ?? ''}${e.message ?? e.violatedDirective}\n`; };
  addEventListener('error', failed);
  addEventListener('securitypolicyviolation', failed);

  // Numbers of a point: its <title>, shown at once and for the keyboard too.
  const tip = document.createElement('div');
  tip.id = 'tip';
  tip.hidden = true;
  document.body.append(tip);
  const show = point => {
    tip.textContent = point.getAttribute('aria-label');
    tip.hidden = false;
    const at = point.querySelector('.fh-target').getBoundingClientRect();
    const { width, height } = tip.getBoundingClientRect();
    const left = Math.min(Math.max(8, at.left + at.width / 2 - width / 2), root.clientWidth - width - 8);
    const above = at.top - height - 6;
    tip.style.transform = `translate(${left}px, ${above < 8 ? at.bottom + 6 : above}px)`;
  };
  const hide = () => { tip.hidden = true; };
  const points = document.querySelectorAll('.fh-point');
  for (const point of points) {
    const title = point.querySelector('title');
    point.setAttribute('aria-label', title.textContent);
    title.remove();
    const target = point.querySelectorAll('.fh-target, .fh-mark, .fh-label');
    for (const part of target) {
      part.addEventListener('pointerenter', () => show(point));
      part.addEventListener('pointerleave', hide);
    }
    point.addEventListener('focus', () => show(point));
    point.addEventListener('blur', hide);
  }
  addEventListener('keydown', e => { if (e.key === 'Escape') hide(); });
  addEventListener('scroll', hide, { passive: true });

  // Tables: a click on a column sorts by it; what has no number stays last.
  const value = cell => cell.dataset.v === undefined ? cell.textContent : cell.dataset.v === '' ? NaN : +cell.dataset.v;
  const compare = (a, b) => typeof a === 'string' ? a.localeCompare(b) : a - b;
  for (const head of document.querySelectorAll('thead th')) {
    const button = document.createElement('button');
    button.append(...head.childNodes);
    head.append(button);
    button.addEventListener('click', () => {
      const down = head.getAttribute('aria-sort') === 'ascending';
      for (const other of head.parentNode.children) other.removeAttribute('aria-sort');
      head.setAttribute('aria-sort', down ? 'descending' : 'ascending');
      const body = head.closest('table').tBodies[0];
      const rows = [...body.rows].map(row => [value(row.cells[head.cellIndex]), row]);
      rows.sort(([a], [b]) => Number.isNaN(a) - Number.isNaN(b) || (down ? compare(b, a) : compare(a, b)));
      body.append(...rows.map(([, row]) => row));
    });
  }
  root.dataset.points = points.length;
}
